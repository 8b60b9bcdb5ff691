"""Points within the support radius, found over cells of that size."""

import taichi as ti

from sim import runtime
from sim.registry import register
from sim.runtime import TURNS
from sim.schema import Model
from sim.search.pair_list import BLOCK, PairList, first_room
from sim.search.sieve import LANES, Sieve
from sim.search.torus import Torus
from sim.stage import Build, Stage
from sim.state import Row

CELLS_MAX = 1 << 22
"""Water spread wider than this gets larger cells: clearing and summing them would cost more than they save."""
LONGER = 1.2
"""So much must an axis be, to be the slowest of the sort instead of z: a cube is not to be sorted anew at each step."""
FINE = 4
"""Cells along x in one support radius. More: fewer candidates to try, more cells to sum."""


@register("search", "grid")
@ti.data_oriented
class GridSearch:
    """All pairs |x_i - x_j| < H. Sorts the fluid rows by cell, x fastest, by a stable counting sort (Green 2010).
    Much water is sorted with its longest axis slowest (`turned`): few rows lie between those of neighbours.

    Rows of cells that follow each other along x lie together: nine stretches of rows hold all candidates, cut to
    [x - H, x + H] by cells that are finer along x. Cells fill the box of the water, within space; a particle outside
    counts where it is clamped to, which moves no two of them further apart. Along periodic axes cells close the ring:
    they go evenly into space.
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
        self.per_length = ti.Vector.field(3, float, shape=())  # cells in a metre
        self.torus = Torus(space)
        self.shape = ti.Vector.field(3, ti.i32, shape=())
        self.first = ti.field(ti.i32, shape=CELLS_MAX + 2)
        capacity = build.state.sizes["fluid"]
        self.list = PairList(capacity, first_room(config.fluid.support))
        self.sieve = Sieve(capacity, self.support_radius, self.torus)
        self.few = runtime.few(capacity)
        self.turns = runtime.many(capacity, config.cloth is not None) and not self.torus.axes
        self.slowest = ti.field(ti.i32, ())
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
    def _turned(self, x):
        """(x, y, z), turned until the longest axis of much water is last."""
        if ti.static(self.turns):
            if self.slowest[None] == 0:
                x = x.zyx
            elif self.slowest[None] == 1:
                x = x.xzy
        return x

    @ti.func
    def _clamped(self, x):
        """Where x counts, turned; relative to the low corner of the cells. A NaN counts into the first cell."""
        return self._turned(ti.math.clamp(self.torus.wrap(x), self.low[None], self.high[None]) - self.low[None])

    @ti.func
    def _coordinates(self, place):
        """Cell of a place, which is not negative."""
        return ti.math.clamp(ti.cast(place * self.per_length[None], ti.i32), 0, self.shape[None] - 1)

    @ti.func
    def _lay_cells(self):
        """Cells over the box of all particles, of edge H (along x H/FINE) or, where they would be too many, larger."""
        for a in ti.static(self.torus.axes):
            self.low[None][a], self.high[None][a] = self.space_low[a], self.space_high[a]
        size = self.high[None] - self.low[None]
        if ti.static(self.turns):
            slowest, longest = 2, size.z
            for a in ti.static(range(2)):
                if size[a] > LONGER * longest:
                    slowest, longest = a, size[a]
            self.slowest[None] = slowest
            size = self._turned(size)
        edge = self.support_radius * 1.0001
        n = ti.Vector([0, 0, 0])
        cells = ti.i64(CELLS_MAX) + 1
        while cells > CELLS_MAX:
            self.per_length[None] = ti.Vector([FINE, 1.0, 1.0]) / edge
            n = ti.cast(size * self.per_length[None], ti.i32) + 1
            for a in ti.static(self.torus.axes):
                n[a] = ti.max(n[a] - 1, 1)
                self.per_length[None][a] = n[a] / size[a]
            cells = ti.i64(n.x) * n.y * n.z
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
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            self.sieve.take(self.x, i)
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
        x, place, n = self.sieve.at(i), self._clamped(self.x[i]), self.shape[None]
        self.list.middle[i] = cursor
        c = self._coordinates(place)
        fine, reach = self.per_length[None].x, 1.0001 * self.support_radius
        left = ti.cast(ti.floor((place.x - reach) * fine), ti.i32)
        right = ti.cast(ti.floor((place.x + reach) * fine), ti.i32)
        z_first, z_end = self.torus.window(2, c.z, n.z)
        y_first, y_end = self.torus.window(1, c.y, n.y)
        for b in range(z_first, z_end):
            for a in range(y_first, y_end):
                line = (self.torus.cell(2, b, c.z, n.z) * n.y + self.torus.cell(1, a, c.y, n.y)) * n.x
                for part in ti.static(range(self.torus.parts)):
                    first, last = self.torus.stretch(part, left, right, n.x)
                    first, last = self.first[line + first], self.first[line + last + 1]
                    need = ti.max(need, cursor - begin + last - first + LANES)
                    j = first
                    while j < last:
                        bits = self.sieve.near(x, i, j, last)
                        if need <= space:
                            self.sieve.write(neighbour, cursor, j, bits)
                        if j <= i and i < j + LANES:
                            self.list.middle[i] = cursor + ti.math.popcnt(bits & ((1 << (i - j)) - 1))
                        cursor += ti.math.popcnt(bits)
                        j += LANES
        return cursor, need
