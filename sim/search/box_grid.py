"""Boxes sorted into cells by their low corners; no tree."""

import taichi as ti
import taichi.math as tm

from sim.registry import register
from sim.search.boxes import overlap

ALIKE = 1.5
"""Boxes up to so many mean sides long stand in the first level; twice that in the second, and so on."""
EDGE, FINE = 0.5, 2
"""Edge of a level's cells, in its longest boxes; and how many times finer along x, where a row is one stretch."""
CELLS_PER_BOX, CELLS_LEAST = 8, 32_768
LEVELS = 12


@register("search.boxes", "grid")
@ti.data_oriented
class BoxGrid:
    """No tree: each box once in the cell of its low corner, by counting, O(m + cells); a query looks back by a box.

    Boxes of unlike size stand in levels of their own, as in a hierarchical grid (Ericson 2005, ch. 7.2), which a sheet
    hardly ever needs. Cells are monotone in x, also in f32, and a query looks back a rounding farther.
    """

    leaves_out = True

    def __init__(self, box_count: int):
        self.box_count = box_count
        self.cell_count = max(CELLS_PER_BOX * box_count, CELLS_LEAST)
        self.start = ti.field(ti.i32, shape=self.cell_count + LEVELS + 2)
        self.cell, self.kept, self.slots = (ti.field(ti.i32, shape=max(box_count, 1)) for _ in range(3))
        self.low, self.high = (ti.Vector.field(3, float, shape=()) for _ in range(2))
        self.mean, self.rounding = ti.field(float, shape=()), ti.field(float, shape=())
        self.levels = ti.field(ti.i32, shape=())
        self.first, self.shape = ti.field(ti.i32, shape=LEVELS + 1), ti.Vector.field(3, ti.i32, shape=LEVELS)
        self.per_length, self.longest = (ti.Vector.field(3, float, shape=LEVELS) for _ in range(2))

    def build(self, low, high, wanted=None) -> None:
        """Sort boxes [low[b], high[b]] into cells; of `wanted` only those where it is not 0."""
        self._sort(low, high, self.kept if wanted is None else wanted, wanted is not None)

    refit = build

    @ti.kernel
    def _sort(self, low: ti.template(), high: ti.template(), wanted: ti.template(), choose: ti.template()):
        ti.loop_config(serialize=True)
        for _ in range(1):
            count = self._keep(wanted, choose)
            top = self._measure(low, high, count)
            self._lay_cells(top)
            cells = self.first[self.levels[None]]
            for c in range(cells + 2):
                self.start[c] = 0
            for k in range(count):
                p = self.kept[k]
                n = self._level(low[p], high[p])
                at = self._cell_of(n, low[p])
                c = self.first[n] + (at[2] * self.shape[n][1] + at[1]) * self.shape[n][0] + at[0]
                self.cell[k] = c
                self.start[c + 2] += 1
            before = 0
            for c in range(2, cells + 2):
                before += self.start[c]
                self.start[c] = before
            for k in range(count):
                slot = self.start[self.cell[k] + 1]
                self.slots[slot] = self.kept[k]
                self.start[self.cell[k] + 1] = slot + 1

    @ti.func
    def _keep(self, wanted: ti.template(), choose: ti.template()):
        """Note which boxes there are to sort; returns how many."""
        count = 0
        for p in range(self.box_count):
            keep = 1
            if ti.static(choose):
                keep = wanted[p]
            self.kept[count] = p
            count += keep
        return count

    @ti.func
    def _measure(self, low: ti.template(), high: ti.template(), count):
        """Bounds of all, mean side and longest boxes of each level; returns the highest of the low corners."""
        a, b, c, sides = tm.vec3(1e30), tm.vec3(-1e30), tm.vec3(-1e30), 0.0
        for k in range(count):
            p = self.kept[k]
            a, b, c = ti.min(a, low[p]), ti.max(b, low[p]), ti.max(c, high[p])
            sides += (high[p] - low[p]).max()
        self.low[None], self.high[None], self.mean[None] = a, c, sides / ti.max(count, 1)
        self.rounding[None] = 1e-6 * ti.max(ti.abs(a), ti.abs(b)).max()
        self.levels[None] = 0
        for n in range(LEVELS):
            self.longest[n] = tm.vec3(-1.0)
        for k in range(count):
            p = self.kept[k]
            n = self._level(low[p], high[p])
            self.longest[n] = ti.max(self.longest[n], high[p] - low[p])
            self.levels[None] = ti.max(self.levels[None], n + 1)
        return b

    @ti.func
    def _level(self, low, high):
        """Which level a box belongs to: the first that is long enough, or the last."""
        side, limit, n = (high - low).max(), ALIKE * self.mean[None], 0
        while side > limit and n < LEVELS - 1:
            limit *= 2.0
            n += 1
        return n

    @ti.func
    def _lay_cells(self, top):
        """Cells of each level from the low corner to the top one, as many as there are in all."""
        size, growth = top - self.low[None], 1.0
        total = self.cell_count + 1
        while total > self.cell_count:
            total = 0
            for n in range(self.levels[None]):
                self.first[n] = total
                edge = growth * ti.max(EDGE * self.longest[n].max(), 1e-6 * size.max(), 1e-12)
                self.per_length[n] = tm.vec3(FINE, 1.0, 1.0) / edge
                cells = ti.floor(size * self.per_length[n]) + 1.0
                if self.longest[n].max() < 0.0:
                    cells = tm.vec3(1.0)
                self.shape[n] = ti.cast(ti.min(cells, self.cell_count), ti.i32)
                if cells[0] * cells[1] * cells[2] + total > self.cell_count:
                    total = self.cell_count + 1
                else:
                    total += self.shape[n][0] * self.shape[n][1] * self.shape[n][2]
            growth *= 1.3
        self.first[self.levels[None]] = total

    @ti.func
    def _cell_of(self, n, x):
        """Cell of a place in level n, or the nearest."""
        place = (x - self.low[None]) * self.per_length[n]
        last = self.shape[n] - 1
        return ti.cast(tm.clamp(place, 0.0, ti.cast(last, float)), ti.i32)

    @ti.func
    def begin(self, low, high):
        levels = self.levels[None] * ti.cast(overlap(low, high, self.low[None], self.high[None]), ti.i32)
        return ti.Vector([0, levels, 0, 0, 0, 0, 0, 0])

    @ti.func
    def next(self, walk, low, high):
        """One row of cells along x of one level; walk: level, levels, rows left, in this layer, cell, width, layers."""
        n, first, last = walk[0], 0, 0
        if walk[2] == 0:
            back = low - self.longest[n] - self.rounding[None]
            a, b = self._cell_of(n, back), self._cell_of(n, high)
            span = b - a + 1
            if self.longest[n].max() < 0.0:
                span[2] = 0
            cell = self.first[n] + (a[2] * self.shape[n][1] + a[1]) * self.shape[n][0] + a[0]
            walk = ti.Vector([n, walk[1], span[1] * span[2], span[1], cell, span[0], span[1], 0])
        if walk[2] > 0:
            first, last = self.start[walk[4]], self.start[walk[4] + walk[5]]
            walk[2] -= 1
            walk[3] -= 1
            walk[4] += self.shape[n][0]
            if walk[3] == 0:
                walk[3] = walk[6]
                walk[4] += (self.shape[n][1] - walk[6]) * self.shape[n][0]
        if walk[2] == 0:
            walk[0] = n + 1
        return walk, first, last
