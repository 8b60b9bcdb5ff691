"""Every box for every query."""

import taichi as ti

from sim.registry import register


@register("search.boxes", "brute")
@ti.data_oriented
class BoxBrute:
    """All boxes, one by one. The truth that the other searches are held to."""

    leaves_out = False

    def __init__(self, box_count: int):
        self.box_count = box_count
        self.slots = ti.field(ti.i32, shape=max(box_count, 1))
        self._number()

    @ti.kernel
    def _number(self):
        for p in range(self.slots.shape[0]):
            self.slots[p] = p

    def build(self, low, high) -> None:
        """Nothing to sort."""

    refit = build

    @ti.func
    def begin(self, low, high):
        return ti.Vector([0, 1])

    @ti.func
    def next(self, walk, low, high):
        return ti.Vector([1, 1]), 0, self.box_count
