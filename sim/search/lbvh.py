"""A tree along a space-filling curve: built in parallel, refitted in linear time."""

import taichi as ti
import taichi.math as tm

from sim.registry import register
from sim.search.radix import Radix
from sim.search.tree import Tree

LEAF = 8
"""Boxes a leaf. Four: a third more to build and refit, and queries 2 % faster."""
WORN = 1.5
"""Refitted nodes may span so many times what they did when built."""
LOOK = 16
"""Refits between two looks at that: looking takes as long as refitting, and a tree wears slowly."""


@register("search.boxes", "lbvh")
@ti.data_oriented
class BoxLbvh(Tree):
    """Radix tree over Morton codes of the centres, every node found by itself (Karras 2012). Serial: the sort alone.

    refit() keeps the tree and follows the boxes, O(m); seen to span WORN times what it did, it is built again.
    builds   how often it has built
    """

    def __init__(self, box_count: int):
        super().__init__(box_count, LEAF)
        self.radix = Radix(box_count)
        leaves = max(self.leaf_count, 1)
        self.code = ti.field(ti.i64, shape=leaves)
        self.end, self.split = ti.field(ti.i32, shape=leaves), ti.field(ti.i32, shape=leaves)
        self.base = ti.field(ti.i32, shape=leaves + 1)
        self.low, self.high = ti.Vector.field(3, float, shape=()), ti.Vector.field(3, float, shape=())
        self.builds, self.refits, self.spanned = 0, 0, 0.0

    def build(self, low, high) -> None:
        """Codes, sort, nodes, bounds."""
        self._sort(low, high)
        self._lay_nodes()
        self.bound(low, high)
        self.builds, self.refits, self.spanned = self.builds + 1, 0, self.spans(low, high)

    def refit(self, low, high) -> None:
        """Bounds only, unless the tree is worn out."""
        self.refits += 1
        self.bound(low, high)
        if self.builds == 0 or self.refits % LOOK == 0 and self.spans(low, high) > WORN * self.spanned:
            self.build(low, high)

    @ti.kernel
    def _sort(self, low: ti.template(), high: ti.template()):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.low[None], self.high[None] = tm.vec3(1e30), tm.vec3(-1e30)
        ti.loop_config(serialize=self.few)
        for p in range(self.box_count):
            ti.atomic_min(self.low[None], low[p] + high[p])
            ti.atomic_max(self.high[None], low[p] + high[p])
        ti.loop_config(serialize=self.few)
        for p in range(self.box_count):
            place = (low[p] + high[p] - self.low[None]) / ti.max((self.high[None] - self.low[None]).max(), 1e-30)
            self.radix.key[p] = _morton(ti.cast(ti.min(1024.0 * place, 1023.0), ti.u32))
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.radix.sort()
        ti.loop_config(serialize=self.few)
        for s in range(self.box_count):
            self.slots[s] = self.radix.order[s]
        ti.loop_config(serialize=self.few)
        for k in range(self.leaf_count):
            self.code[k] = (ti.cast(self.radix.key[k * self.leaf_size], ti.i64) << 32) | k

    @ti.kernel
    def _lay_nodes(self):
        ti.loop_config(serialize=self.few)
        for k in range(self.leaf_count - 1):
            self._find_node(k)
        # A node that starts at leaf k is its own k-th or a left child of one: a chain, laid out in one stretch.
        ti.loop_config(serialize=self.few)
        for k in range(self.leaf_count):
            n, i = 1, k
            inner = k < self.leaf_count - 1 and self.end[k] > k
            while inner:
                n += 1
                i = self.split[i]
                inner = i != k
            self.base[k + 1] = n
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.base[0] = 0
            for k in range(self.leaf_count):
                self.base[k + 1] += self.base[k]
        ti.loop_config(serialize=self.few)
        for k in range(self.leaf_count):
            i = k
            for at in range(self.base[k], self.base[k + 1] - 1):
                self.node[at].skip = self.base[ti.max(i, self.end[i]) + 1]
                self.node[at].leaf = -1
                i = self.split[i]
            at = self.base[k + 1] - 1
            self.node[at].skip, self.node[at].leaf = at + 1, k
            self.leaf_at[k] = at

    @ti.func
    def _find_node(self, i):
        """Leaves i..end[i] (which may lie below i) and the last of its left half."""
        d = 1
        if _nearer(self._differ(i, i - 1), self._differ(i, i + 1)):
            d = -1
        least = self._differ(i, i - d)
        step = 2
        while _nearer(self._differ(i, i + step * d), least):
            step *= 2
        length = 0
        while step > 1:
            step //= 2
            if _nearer(self._differ(i, i + (length + step) * d), least):
                length += step
        end = i + length * d
        whole = self._differ(i, end)
        split, step = 0, length
        while step > 1:
            step = (step + 1) // 2
            if _nearer(self._differ(i, i + (split + step) * d), whole):
                split += step
        self.end[i], self.split[i] = end, i + split * d + ti.min(d, 0)

    @ti.func
    def _differ(self, i, j):
        """Bits in which two leaves differ; beyond the ends, a higher one than any."""
        bits = ti.cast(1, ti.i64) << 62
        if 0 <= j < self.leaf_count:
            bits = self.code[i] ^ self.code[j]
        return bits


@ti.func
def _nearer(a, b):
    """Is the highest bit of a lower than that of b?"""
    return a < b and a < (a ^ b)


@ti.func
def _morton(c):
    """Bits of three 10-bit numbers, interleaved."""
    code = ti.u32(0)
    for axis in ti.static(range(3)):
        x = c[axis]
        x = (x | (x << 16)) & ti.u32(0x030000FF)
        x = (x | (x << 8)) & ti.u32(0x0300F00F)
        x = (x | (x << 4)) & ti.u32(0x030C30C3)
        x = (x | (x << 2)) & ti.u32(0x09249249)
        code |= x << (2 - axis)
    return code
