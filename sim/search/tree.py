"""What the trees over boxes share: nodes laid out in the order of descent, their bounds, and the walk."""

import taichi as ti
import taichi.math as tm

from sim import runtime
from sim.maths.order import less, more
from sim.search.boxes import overlap


@ti.data_oriented
class Tree:
    """Binary tree of boxes; a node stands before its left subtree, that before the right, so a walk needs no stack.

    slots[n]    boxes in the order of the leaves; leaf k holds slots k * leaf_size .. (k + 1) * leaf_size
    node[i]     low, high [m]; skip: the node after the subtree of i; leaf: its number, or -1 for an inner node
    leaf_at[k]  node of leaf k

    A method fills slots, skip, leaf and leaf_at, then calls bound().
    """

    leaves_out = False

    def __init__(self, box_count: int, leaf_size: int):
        self.box_count, self.leaf_size = box_count, leaf_size
        self.leaf_count = -(-box_count // leaf_size)
        self.node_count = max(2 * self.leaf_count - 1, 0)
        corner = ti.types.vector(3, float)
        self.node = ti.Struct.field(
            {"low": corner, "high": corner, "skip": ti.i32, "leaf": ti.i32}, shape=max(self.node_count, 1)
        )
        self.slots = ti.field(ti.i32, shape=max(box_count, 1))
        self.leaf_at = ti.field(ti.i32, shape=max(self.leaf_count, 1))
        self.few = runtime.few(8 * box_count)

    @ti.kernel
    def bound(self, low: ti.template(), high: ti.template()):
        """Bounds from the leaves up, O(m)."""
        ti.loop_config(serialize=self.few)
        for k in range(self.leaf_count):
            a, b = tm.vec3(1e30), tm.vec3(-1e30)
            for s in range(k * self.leaf_size, ti.min((k + 1) * self.leaf_size, self.box_count)):
                p = self.slots[s]
                a, b = less(a, low[p]), more(b, high[p])
            i = self.leaf_at[k]
            self.node[i].low, self.node[i].high = a, b
        ti.loop_config(serialize=True)
        for n in range(self.node_count):
            i = self.node_count - 1 - n
            if self.node[i].leaf < 0:
                other = self.node[i + 1].skip
                self.node[i].low = less(self.node[i + 1].low, self.node[other].low)
                self.node[i].high = more(self.node[i + 1].high, self.node[other].high)

    @ti.kernel
    def spans(self, low: ti.template(), high: ti.template()) -> float:
        """What the nodes span beyond a mean box: sum of half surfaces [m^2]. Less is better to walk.

        Boxes grown all alike span the same: the mean box is taken off each side. Serial: one order, one sum.
        """
        spanned = 0.0
        ti.loop_config(serialize=True)
        for _ in range(1):
            mean = tm.vec3(0.0)
            for p in range(self.box_count):
                mean += high[p] - low[p]
            mean /= ti.max(self.box_count, 1)
            for i in range(self.node_count):
                e = ti.max(self.node[i].high - self.node[i].low - mean, 0.0)
                spanned += e[0] * e[1] + e[1] * e[2] + e[2] * e[0]
        return spanned

    @ti.func
    def begin(self, low, high):
        return ti.Vector([0, self.node_count])

    @ti.func
    def next(self, walk, low, high):
        """On to the next leaf that the query touches."""
        i, first, last = walk[0], 0, 0
        while first == last and i < self.node_count:
            if overlap(low, high, self.node[i].low, self.node[i].high):
                leaf = self.node[i].leaf
                if leaf >= 0:
                    first = leaf * self.leaf_size
                    last = ti.min(first + self.leaf_size, self.box_count)
                i += 1
            else:
                i = self.node[i].skip
        walk[0] = i
        return walk, first, last
