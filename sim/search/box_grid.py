"""Boxes listed in the cells that they touch; no tree."""

import taichi as ti
import taichi.math as tm

from sim.registry import register

CELL = 1.0
"""Edge of a cell in mean longest sides of a box. Less: more listings to write; more: more boxes to test."""
CELLS_PER_BOX, CELLS_LEAST = 8, 32_768
SLOTS_PER_BOX = 32


@register("search.boxes", "grid")
@ti.data_oriented
class BoxGrid:
    """Uniform cells over all boxes and one flat list filled by counting; no tree, O(m + cells) to build.

    Cells are monotone in x (also in f32), so a query that overlaps a box meets it, perhaps in more than one cell. Where
    the boxes need more cells or slots than there are, the edge grows until they fit: never cut short.
    """

    def __init__(self, box_count: int):
        self.box_count = box_count
        self.cell_count = max(CELLS_PER_BOX * box_count, CELLS_LEAST)
        self.slot_count = max(SLOTS_PER_BOX * box_count, 1024)
        self.start = ti.field(ti.i32, shape=self.cell_count + 1)
        self.cursor = ti.field(ti.i32, shape=self.cell_count)
        self.slots = ti.field(ti.i32, shape=self.slot_count)
        self.low = ti.Vector.field(3, float, shape=())
        self.edge = ti.field(float, shape=())
        self.dims = ti.Vector.field(3, ti.i32, shape=())

    def build(self, low, high) -> None:
        """Sort boxes [low[b], high[b]] into cells."""
        growth = 1.0
        while self._build(low, high, growth) > self.slot_count:
            growth *= 2.0

    refit = build

    @ti.kernel
    def _build(self, low: ti.template(), high: ti.template(), growth: float) -> ti.i32:
        total = 0
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._lay_cells(low, high, growth)
            cells = self.dims[None][0] * self.dims[None][1] * self.dims[None][2]
            for c in range(cells):
                self.cursor[c] = 0
            for p in range(self.box_count):
                first, last = self._window(low[p], high[p])
                for i, j, k in ti.ndrange((first[0], last[0] + 1), (first[1], last[1] + 1), (first[2], last[2] + 1)):
                    self.cursor[self._flat(i, j, k)] += 1
            for c in range(cells):
                count = self.cursor[c]
                self.start[c] = total
                self.cursor[c] = total
                total += count
            self.start[cells] = total
            if total <= self.slot_count:
                self._fill(low, high)
        return total

    @ti.func
    def _lay_cells(self, low: ti.template(), high: ti.template(), growth: float):
        a, b, sides = tm.vec3(1e30), tm.vec3(-1e30), 0.0
        for p in range(self.box_count):
            a = ti.min(a, low[p])
            b = ti.max(b, high[p])
            sides += (high[p] - low[p]).max()
        if self.box_count == 0:
            a, b = tm.vec3(0.0), tm.vec3(0.0)
        e = ti.max(growth * CELL * sides / ti.max(self.box_count, 1), 1e-6 * (b - a).max(), 1e-12)
        counts = ti.floor((b - a) / e) + 1.0
        while counts[0] * counts[1] * counts[2] > self.cell_count:
            e *= 1.3
            counts = ti.floor((b - a) / e) + 1.0
        self.low[None] = a
        self.edge[None] = e
        self.dims[None] = ti.cast(counts, ti.i32)

    @ti.func
    def _fill(self, low: ti.template(), high: ti.template()):
        for p in range(self.box_count):
            first, last = self._window(low[p], high[p])
            for i, j, k in ti.ndrange((first[0], last[0] + 1), (first[1], last[1] + 1), (first[2], last[2] + 1)):
                c = self._flat(i, j, k)
                self.slots[self.cursor[c]] = p
                self.cursor[c] += 1

    @ti.func
    def _window(self, low, high):
        """(first, last) cells that a box touches; empty where last < first."""
        dims = self.dims[None]
        a = ti.max(ti.floor((low - self.low[None]) / self.edge[None]), -1.0)
        b = ti.min(ti.floor((high - self.low[None]) / self.edge[None]), ti.cast(dims, float))
        first = ti.max(ti.cast(a, ti.i32), 0)
        last = ti.min(ti.cast(b, ti.i32), dims - 1)
        return first, last

    @ti.func
    def _flat(self, i, j, k):
        return (i * self.dims[None][1] + j) * self.dims[None][2] + k

    @ti.func
    def begin(self, low, high):
        first, last = self._window(low, high)
        span = ti.max(last - first + 1, 0)
        return ti.Vector([0, span[0] * span[1] * span[2], first[0], first[1], first[2], span[1], span[2]])

    @ti.func
    def next(self, walk, low, high):
        n, row = walk[0], walk[0] // walk[6]
        c = self._flat(walk[2] + row // walk[5], walk[3] + row % walk[5], walk[4] + n % walk[6])
        walk[0] += 1
        return walk, self.start[c], self.start[c + 1]
