"""Points within the support radius, found over cells of that size."""

import taichi as ti

from sim import runtime
from sim.registry import register
from sim.runtime import TURNS
from sim.schema import Model
from sim.search.pair_list import BLOCK, PairList, first_room
from sim.stage import Build, Stage
from sim.state import Row

CELLS_MAX = 1 << 22
"""Water spread wider than this gets larger cells: clearing and summing them would cost more than they save."""
FINE = 4
"""Cells along x in one support radius. More: fewer candidates to try, more cells to sum."""


@register("search", "grid")
@ti.data_oriented
class GridSearch:
    """All pairs |x_i - x_j| < H. Sorts the fluid rows by cell, x fastest, by a stable counting sort (Green 2010).

    Rows of cells that follow each other along x lie together: nine stretches of rows hold all candidates, cut to
    [x - H, x + H] by cells that are finer along x. Cells fill the box of the water, within space; a particle outside
    counts where it is clamped to, which moves no two of them further apart.
    """

    class Params(Model):
        """None: cells are one support radius wide."""

    rows = ("fluid.x",)
    scratch = (
        Row("fluid.search.cell", "i", "1", "cell of each row before sorting", saved=False),
        Row("fluid.order", "i", "1", "old row of each new row", saved=False),
    )

    def __init__(self, build: Build, params: Params):
        config = build.config
        self.state = build.state
        self.x = build.state["fluid.x"]
        self.cell, self.order = build.state["fluid.search.cell"], build.state["fluid.order"]
        self.support_radius = config.fluid.support_radius
        space = config.space
        self.space_low, self.space_high = (ti.Vector([float(a) for a in c]) for c in (space.low, space.high))
        self.low, self.high = ti.Vector.field(3, float, shape=()), ti.Vector.field(3, float, shape=())
        self.edge = ti.field(float, shape=())
        self.shape = ti.Vector.field(3, ti.i32, shape=())
        self.first = ti.field(ti.i32, shape=CELLS_MAX + 2)
        capacity = build.state.sizes["fluid"]
        self.list = PairList(capacity, first_room(config.fluid.support))
        self.few = runtime.few(build.state.sizes["fluid"])
        build.parts["search"] = self

    def stages(self) -> tuple[Stage, ...]:
        """One stage: sort, then list."""
        moving = self.state.moving
        return (Stage("neighbours", "sort", lambda dt: self.build(), moving, moving),)

    def build(self) -> None:
        """Sort all saved fluid rows by cell and list the pairs."""
        self._sort()
        self.state.permute_fluid(self.order)
        self.list.fill(self._fill)

    def refit(self) -> None:
        """Cells are cheap: builds."""
        self.build()

    @ti.func
    def _clamped(self, x):
        """Where x counts; relative to the low corner of the cells. A NaN counts into the first cell."""
        return ti.math.clamp(x, self.low[None], self.high[None]) - self.low[None]

    @ti.func
    def _coordinates(self, place):
        """Cell of a place, which is not negative."""
        fine = ti.Vector([FINE, 1.0, 1.0]) / self.edge[None]
        return ti.math.clamp(ti.cast(place * fine, ti.i32), 0, self.shape[None] - 1)

    @ti.func
    def _lay_cells(self):
        """Cells over the box of all particles, of edge H (along x H/FINE) or, where they would be too many, larger."""
        size = self.high[None] - self.low[None]
        edge = self.support_radius * 1.0001
        n = ti.Vector([0, 0, 0])
        cells = ti.i64(CELLS_MAX) + 1
        while cells > CELLS_MAX:
            n = ti.cast(size * ti.Vector([FINE, 1.0, 1.0]) / edge, ti.i32) + 1
            cells = ti.i64(n.x) * n.y * n.z
            self.edge[None] = edge
            edge *= 1.3
        self.shape[None] = n

    @ti.kernel
    def _sort(self):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.low[None], self.high[None] = self.space_high, self.space_low
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            x = ti.math.clamp(self.x[i], self.space_low, self.space_high)
            ti.atomic_min(self.low[None], x)
            ti.atomic_max(self.high[None], x)
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._lay_cells()
        ti.loop_config(serialize=self.few)
        for c in range(self.shape[None].x * self.shape[None].y * self.shape[None].z + 2):
            self.first[c] = 0
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            c, n = self._coordinates(self._clamped(self.x[i])), self.shape[None]
            self.cell[i] = (c.z * n.y + c.y) * n.x + c.x
        # Serial: 10 ns a particle, in an order that no thread count can change.
        ti.loop_config(serialize=True)
        for i in range(self.state.count[None]):
            self.first[self.cell[i] + 2] += 1
        ti.loop_config(serialize=True)
        for c in range(2, self.shape[None].x * self.shape[None].y * self.shape[None].z + 2):
            self.first[c] += self.first[c - 1]
        ti.loop_config(serialize=True)
        for i in range(self.state.count[None]):
            slot = self.first[self.cell[i] + 1]
            self.order[slot] = i
            self.first[self.cell[i] + 1] = slot + 1

    @ti.kernel
    def _fill(self, neighbour: ti.template(), room: ti.i32) -> ti.i32:
        """List block by block; returns the entries that the fullest block wants."""
        wanted = 0
        count = self.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                block = turn // TURNS
                begin = block * BLOCK * room
                cursor, need = begin, 0
                for i in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
                    self.list.start[i] = cursor
                    cursor, need = self._row(i, neighbour, cursor, begin, need, BLOCK * room)
                    self.list.stop[i] = cursor
                ti.atomic_max(wanted, need)
        return wanted

    @ti.func
    def _row(self, i, neighbour: ti.template(), cursor, begin, need, space):
        """List the neighbours of i from `cursor` on; the cursor after them, and what the block needs so far."""
        h_sq = self.support_radius * self.support_radius
        x, place, n = self.x[i], self._clamped(self.x[i]), self.shape[None]
        c = self._coordinates(place)
        fine, reach = FINE / self.edge[None], 1.0001 * self.support_radius
        left = ti.cast(ti.max(place.x - reach, 0.0) * fine, ti.i32)
        right = ti.min(ti.cast((place.x + reach) * fine, ti.i32), n.x - 1)
        for z in range(ti.max(c.z - 1, 0), ti.min(c.z + 2, n.z)):
            for y in range(ti.max(c.y - 1, 0), ti.min(c.y + 2, n.y)):
                line = (z * n.y + y) * n.x
                first, last = self.first[line + left], self.first[line + right + 1]
                need = ti.max(need, cursor - begin + last - first)
                # Always write, then keep it by counting: a fifth of the candidates are near, at random, and a branch
                # on that costs more than the write.
                for j in range(first, last):
                    r = x - self.x[j]
                    if need <= space:
                        neighbour[cursor] = j
                    cursor += ti.cast((r.norm_sqr() < h_sq) & (j != i), ti.i32)
        return cursor, need
