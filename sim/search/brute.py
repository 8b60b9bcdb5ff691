"""Every particle against every other: the yardstick of searches."""

import taichi as ti

from sim.registry import register
from sim.runtime import TURNS
from sim.schema import Model
from sim.search.pair_list import BLOCK, PairList, first_room
from sim.search.torus import Torus
from sim.stage import Build, Stage


@register("search", "brute")
@ti.data_oriented
class BruteSearch:
    """All pairs |x_i - x_j| < H by trying n^2 of them. Rows stay in their order."""

    class Params(Model):
        """None."""

    rows = ("fluid.x",)
    scratch = ()

    def __init__(self, build: Build, params: Params):
        self.state = build.state
        self.x = build.state["fluid.x"]
        self.support_radius = build.config.fluid.support_radius
        self.torus = Torus(build.config.space)
        capacity = build.state.sizes["fluid"]
        self.list = PairList(capacity, first_room(build.config.fluid.support))
        build.parts["search"] = self

    def stages(self) -> tuple[Stage, ...]:
        """One stage: list."""
        return (Stage("neighbours", "sort", lambda dt: self.build(), ("fluid.x",), ()),)

    def build(self) -> None:
        """List the pairs."""
        self.list.fill(self._fill)

    def refit(self) -> None:
        """There is nothing to keep: builds."""
        self.build()

    @ti.kernel
    def _fill(self, neighbour: ti.template(), room: ti.i32) -> ti.i32:
        """List block by block; returns the entries that the fullest block wants."""
        wanted = 0
        count = self.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                ti.atomic_max(wanted, self._block(turn // TURNS, neighbour, room))
        return wanted

    @ti.func
    def _block(self, block, neighbour: ti.template(), room):
        """List the rows of one block; returns the entries that it wants."""
        count, begin = self.state.count[None], block * BLOCK * room
        cursor = begin
        for i in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
            self.list.start[i] = self.list.middle[i] = ti.min(cursor, begin + BLOCK * room)
            x = self.x[i]
            for j in range(count):
                r = self.torus.nearest(x - self.x[j])
                if r.dot(r) < self.support_radius * self.support_radius and j != i:
                    if cursor < begin + BLOCK * room:
                        neighbour[cursor] = j
                    cursor += 1
                    if j < i:
                        self.list.middle[i] = ti.min(cursor, begin + BLOCK * room)
            self.list.stop[i] = ti.min(cursor, begin + BLOCK * room)
        return cursor - begin
