"""Points within the support radius, found over cells of that size."""

import math

import taichi as ti

from sim.registry import register
from sim.schema import Model
from sim.search.pair_list import BLOCK, PairList, first_room
from sim.stage import Build, Stage
from sim.state import Row

CELLS_MAX = 1 << 22
"""A larger space gets larger cells: clearing and summing cells would cost more than they save."""


@register("search", "grid")
@ti.data_oriented
class GridSearch:
    """All pairs |x_i - x_j| < H. Sorts the fluid rows by cell, x fastest, by a stable counting sort (Green 2010).

    Rows of a cell lie together, and those of three cells along x do too: nine stretches of rows hold all candidates.
    Particles outside the space count into its outermost cells: that moves no two cells further apart.
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
        self.low = ti.Vector([float(a) for a in config.space.low])
        size = [b - a for a, b in zip(config.space.low, config.space.high)]
        edge = max(self.support_radius * 1.0001, (math.prod(size) / CELLS_MAX) ** (1.0 / 3.0))
        self.inverse_edge = 1.0 / edge
        self.shape = tuple(max(math.ceil(s / edge), 1) for s in size)
        self.cell_count = math.prod(self.shape)
        self.first = ti.field(ti.i32, shape=self.cell_count + 2)
        capacity = build.state.sizes["fluid"]
        self.list = PairList(capacity, min(capacity, 65536), first_room(config.fluid.support))
        build.parts["search"] = self

    def stages(self) -> tuple[Stage, ...]:
        """One stage: sort, then list."""
        return (Stage("neighbours", "sort", lambda dt: self.build(), ("fluid.x",), ()),)

    def build(self) -> None:
        """Sort all saved fluid rows by cell and list the pairs."""
        count = self._sort()
        self.state.permute_fluid(self.order)
        self.list.fill(self._fill, count)

    def refit(self) -> None:
        """Cells are cheap: builds."""
        self.build()

    @ti.func
    def _coordinates(self, x):
        """Cell coordinates of a point, clamped into the space; a NaN counts into the first cell."""
        c = ti.cast(ti.floor((x - self.low) * self.inverse_edge), ti.i32)
        return ti.math.clamp(c, 0, ti.Vector(self.shape) - 1)

    @ti.kernel
    def _sort(self) -> ti.i32:
        nx, ny = ti.static(self.shape[0], self.shape[1])
        for c in range(self.cell_count + 2):
            self.first[c] = 0
        for i in range(self.state.count[None]):
            c = self._coordinates(self.x[i])
            self.cell[i] = (c[2] * ny + c[1]) * nx + c[0]
        # Serial: 10 ns a particle, in an order that no thread count can change.
        ti.loop_config(serialize=True)
        for i in range(self.state.count[None]):
            self.first[self.cell[i] + 2] += 1
        ti.loop_config(serialize=True)
        for c in range(2, self.cell_count + 2):
            self.first[c] += self.first[c - 1]
        ti.loop_config(serialize=True)
        for i in range(self.state.count[None]):
            slot = self.first[self.cell[i] + 1]
            self.order[slot] = i
            self.first[self.cell[i] + 1] = slot + 1
        return self.state.count[None]

    @ti.kernel
    def _fill(self, neighbour: ti.types.ndarray(dtype=ti.i32, ndim=1), room: ti.i32) -> ti.i32:
        """List block by block; returns the entries that the fullest block wants."""
        nx, ny, nz = ti.static(self.shape)
        wanted = 0
        count = self.state.count[None]
        ti.loop_config(block_dim=1)
        for block in range((count + BLOCK - 1) // BLOCK):
            begin = block * BLOCK * room
            cursor, need = begin, 0
            for i in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
                self.list.start[i] = cursor
                x = self.x[i]
                c = self._coordinates(x)
                left, right = ti.max(c[0] - 1, 0), ti.min(c[0] + 1, nx - 1)
                for z in range(ti.max(c[2] - 1, 0), ti.min(c[2] + 2, nz)):
                    for y in range(ti.max(c[1] - 1, 0), ti.min(c[1] + 2, ny)):
                        row = (z * ny + y) * nx
                        first, last = self.first[row + left], self.first[row + right + 1]
                        need = ti.max(need, cursor - begin + last - first)
                        # Always write, then keep it by counting: a third of the candidates are near, at random,
                        # and a branch on that costs more than the write.
                        for j in range(first, last):
                            r = x - self.x[j]
                            if need <= BLOCK * room:
                                neighbour[cursor] = j
                            near = (r.dot(r) < self.support_radius * self.support_radius) & (j != i)
                            cursor += ti.cast(near, ti.i32)
                self.list.stop[i] = cursor
            ti.atomic_max(wanted, need)
        return wanted
