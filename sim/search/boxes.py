"""Which boxes may touch a swept point: one protocol, several searches, the same sets after the box test.

build(low, high)      from two vec3 fields, one box an entry
window(low, high)     @ti.func -> (first, last), the cells that a query box touches; empty where last < first
flat(i, j, k)         @ti.func, a cell's place in `start`
start[c]..start[c+1]  the range of `slots` that lists a cell's boxes, sorted by number

A box is listed in every cell it touches, and cells are monotone in x (also in f32): a query that overlaps a box
always meets it, perhaps in more than one cell.
"""

import taichi as ti
import taichi.math as tm

from sim.registry import register

CELLS_MAX = 32_768
SLOTS_PER_BOX = 32


@register("search.boxes", "grid")
@ti.data_oriented
class BoxGrid:
    """Uniform cells over all boxes and one flat list filled by counting; no tree. Cell edge >= `cell` [m].

    Where the boxes need more cells or slots than there are, the edge grows until they fit: never cut short.
    """

    def __init__(self, box_count: int, cell: float):
        self.box_count = box_count
        self.cell_min = cell
        self.capacity = max(SLOTS_PER_BOX * box_count, 1024)
        self.start = ti.field(ti.i32, shape=CELLS_MAX + 1)
        self.cursor = ti.field(ti.i32, shape=CELLS_MAX)
        self.slots = ti.field(ti.i32, shape=self.capacity)
        self.low = ti.Vector.field(3, float, shape=())
        self.edge = ti.field(float, shape=())
        self.dims = ti.Vector.field(3, ti.i32, shape=())

    def build(self, low, high) -> None:
        """Sort boxes [low[b], high[b]] into cells."""
        edge = self.cell_min
        while self._build(low, high, edge) > self.capacity:
            edge *= 2.0

    @ti.kernel
    def _build(self, low: ti.template(), high: ti.template(), edge: float) -> ti.i32:
        total = 0
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._lay_cells(low, high, edge)
            cells = self.dims[None][0] * self.dims[None][1] * self.dims[None][2]
            for c in range(cells):
                self.cursor[c] = 0
            for p in range(self.box_count):
                first, last = self.window(low[p], high[p])
                for i, j, k in ti.ndrange((first[0], last[0] + 1), (first[1], last[1] + 1), (first[2], last[2] + 1)):
                    self.cursor[self.flat(i, j, k)] += 1
            for c in range(cells):
                count = self.cursor[c]
                self.start[c] = total
                self.cursor[c] = total
                total += count
            self.start[cells] = total
            if total <= self.capacity:
                self._fill(low, high)
        return total

    @ti.func
    def _lay_cells(self, low: ti.template(), high: ti.template(), edge: float):
        a, b = tm.vec3(1e30), tm.vec3(-1e30)
        for p in range(self.box_count):
            a = ti.min(a, low[p])
            b = ti.max(b, high[p])
        e = edge
        counts = ti.floor((b - a) / e) + 1.0
        while counts[0] * counts[1] * counts[2] > CELLS_MAX:
            e *= 1.3
            counts = ti.floor((b - a) / e) + 1.0
        self.low[None] = a
        self.edge[None] = e
        self.dims[None] = ti.cast(counts, ti.i32)

    @ti.func
    def _fill(self, low: ti.template(), high: ti.template()):
        for p in range(self.box_count):
            first, last = self.window(low[p], high[p])
            for i, j, k in ti.ndrange((first[0], last[0] + 1), (first[1], last[1] + 1), (first[2], last[2] + 1)):
                c = self.flat(i, j, k)
                self.slots[self.cursor[c]] = p
                self.cursor[c] += 1

    @ti.func
    def window(self, low, high):
        dims = self.dims[None]
        a = ti.max(ti.floor((low - self.low[None]) / self.edge[None]), -1.0)
        b = ti.min(ti.floor((high - self.low[None]) / self.edge[None]), ti.cast(dims, float))
        first = ti.max(ti.cast(a, ti.i32), 0)
        last = ti.min(ti.cast(b, ti.i32), dims - 1)
        return first, last

    @ti.func
    def flat(self, i, j, k):
        return (i * self.dims[None][1] + j) * self.dims[None][2] + k


@register("search.boxes", "brute")
@ti.data_oriented
class BoxBrute:
    """Every box for every query: one cell that lists all. The truth that the other searches are held to."""

    def __init__(self, box_count: int, cell: float):
        self.start = ti.field(ti.i32, shape=2)
        self.slots = ti.field(ti.i32, shape=box_count)
        self._list_all()

    @ti.kernel
    def _list_all(self):
        for p in self.slots:
            self.slots[p] = p
        self.start[0] = 0
        self.start[1] = self.slots.shape[0]

    def build(self, low, high) -> None:
        """Nothing to sort."""

    @ti.func
    def window(self, low, high):
        return tm.ivec3(0), tm.ivec3(0)

    @ti.func
    def flat(self, i, j, k):
        return 0
