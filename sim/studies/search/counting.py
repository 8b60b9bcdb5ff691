"""How many boxes touch boxes around points."""

import taichi as ti

from sim.search.boxes import overlap


@ti.data_oriented
class Counter:
    """Counts over a search's boxes for all points; the count of each point stays in `found`."""

    def __init__(self, boxes, low, high, points):
        self.boxes, self.low, self.high, self.points = boxes, low, high, points
        self.found = ti.field(ti.i32, shape=points.shape)

    @ti.kernel
    def count(self, half: float) -> ti.i64:
        """Boxes that touch the box of this half side [m] around a point, over all points."""
        total = ti.i64(0)
        for i in self.points:
            low, high = self.points[i] - half, self.points[i] + half
            met = 0
            walk = self.boxes.begin(low, high)
            while walk[0] < walk[1]:
                walk, first, last = self.boxes.next(walk, low, high)
                for s in range(first, last):
                    p = self.boxes.slots[s]
                    met += ti.cast(overlap(low, high, self.low[p], self.high[p]), ti.i32)
            self.found[i] = met
            total += met
        return total
