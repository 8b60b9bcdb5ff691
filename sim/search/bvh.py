"""The report's tree over patches."""

import numpy as np
import taichi as ti

from sim.registry import register
from sim.search.radix import Radix, rising
from sim.search.tree import Tree


@register("search.boxes", "bvh")
@ti.data_oriented
class BoxBvh(Tree):
    """The report's 3-d tree: boxes sorted along x, y and z, halved at the median of the longest axis; O(m log m).

    Thrown away and built again each time. A leaf holds one box. The halves keep all three orders (Brown 2015), so the
    longest axis, that of the box of the centres, costs nothing to find. The shape depends on the count alone.
    """

    def __init__(self, box_count: int):
        super().__init__(box_count, 1)
        first, last, skip, leaf = halved(box_count)
        self.first, self.last = _field(first), _field(last)
        self.radix = Radix(box_count)
        self.order = ti.field(ti.i32, shape=(3, max(box_count, 1)))
        self.aside = ti.field(ti.i32, shape=max(box_count, 1))
        self.right = ti.field(ti.i32, shape=max(box_count, 1))
        self.centre = ti.Vector.field(3, ti.f32, shape=max(box_count, 1))
        self._shape(_field(skip), _field(leaf))

    @ti.kernel
    def _shape(self, skip: ti.template(), leaf: ti.template()):
        for i in range(self.node_count):
            self.node[i].skip, self.node[i].leaf = skip[i], leaf[i]
            if leaf[i] >= 0:
                self.leaf_at[leaf[i]] = i

    def build(self, low, high) -> None:
        """Sort, halve, bound."""
        self._halve(low, high)
        self.bound(low, high)

    refit = build

    @ti.kernel
    def _halve(self, low: ti.template(), high: ti.template()):
        ti.loop_config(serialize=True)
        for axis in range(3):
            for p in range(self.box_count):
                centre = 0.5 * (low[p] + high[p])
                self.centre[p] = centre
                self.radix.key[p] = rising(centre[axis])
            self.radix.sort()
            for s in range(self.box_count):
                self.order[axis, s] = self.radix.order[s]
        ti.loop_config(serialize=True)
        for i in range(self.node_count):
            if self.node[i].leaf < 0:
                self._halve_node(self.first[i], self.last[i])
        ti.loop_config(serialize=True)
        for s in range(self.box_count):
            self.slots[s] = self.order[0, s]

    @ti.func
    def _halve_node(self, first, last):
        """Upper half of the longest axis to the right, in each of the three orders."""
        size = ti.Vector([0.0, 0.0, 0.0], ti.f32)
        for axis in ti.static(range(3)):
            size[axis] = self.centre[self.order[axis, last - 1]][axis] - self.centre[self.order[axis, first]][axis]
        longest = 0
        if size[1] > size[0]:
            longest = 1
        if size[2] > ti.max(size[0], size[1]):
            longest = 2
        middle = (first + last) // 2
        for s in range(first, last):
            self.right[self.order[longest, s]] = s >= middle
        for axis in range(3):
            if axis != longest:
                left, right = first, middle
                for s in range(first, last):
                    p = self.order[axis, s]
                    if self.right[p]:
                        self.aside[right] = p
                        right += 1
                    else:
                        self.order[axis, left] = p
                        left += 1
                for s in range(middle, last):
                    self.order[axis, s] = self.aside[s]


def halved(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(first, last, skip, leaf) of each node in the order of descent: 0..count halved until one is left."""
    first, last, skip, leaf = [], [], [], []
    waiting = [(0, count)] if count else []
    while waiting:
        a, b = waiting.pop()
        first.append(a)
        last.append(b)
        skip.append(len(skip) + 2 * (b - a) - 1)
        leaf.append(a if b - a == 1 else -1)
        if b - a > 1:
            waiting += [((a + b) // 2, b), (a, (a + b) // 2)]
    return tuple(np.array(values, np.int32) for values in (first, last, skip, leaf))


def _field(values: np.ndarray):
    field = ti.field(ti.i32, shape=max(len(values), 1))
    if len(values):
        field.from_numpy(values)
    return field
