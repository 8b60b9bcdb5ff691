"""Merge: a particle that has given most of its water away joins its nearest neighbour on the same side."""

import taichi as ti

from sim import runtime
from sim.stage import Build, Stage

LIGHT = 0.3
"""[m0] A particle lighter than this merges."""
HEAVY = 1.3
"""[m0] No particle is made heavier than this."""


@ti.data_oriented
class Merge:
    """Mass, momentum and centre are kept. Pairs across the cloth have left the list, so nothing passes it."""

    def __init__(self, build: Build):
        state = build.state
        self.pairs, self.population = build.parts["pairs"], build.parts["population"]
        self.sides = build.parts["contact"].sides
        self.state_count = state.count
        self.x, self.v = state["fluid.x"], state["fluid.v"]
        self.units = state["fluid.mass_units"]
        self.full = build.scene.water.units
        capacity = state.sizes["fluid"]
        self.few = runtime.few(capacity)
        self.target = ti.field(ti.i32, shape=capacity)

    def stages(self) -> tuple[Stage, ...]:
        """One, at the end of the step: the emptied rows leave at the next source slot."""
        rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.mass_units")
        return (Stage("wetting.merge", "wet", self.run, reads=rows, writes=rows),)

    def run(self, dt: float) -> None:
        """Choose partners by the pair list of this step, then join in row order."""
        if self._choose(self.pairs.neighbour, self.pairs.weight):
            self._join()

    @ti.kernel
    def _choose(self, neighbour: ti.template(), weight: ti.template()) -> ti.i32:
        found = 0
        ti.loop_config(serialize=self.few)
        for i in range(self.state_count[None]):
            self.target[i] = -1
            if self._light(i):
                self.target[i] = self._nearest(i, neighbour, weight)
                if self.target[i] >= 0:
                    found += 1
        return found

    @ti.func
    def _light(self, i):
        return 0 < self.units[i] and ti.cast(self.units[i], ti.f64) < LIGHT * self.full

    @ti.func
    def _nearest(self, i, neighbour: ti.template(), weight: ti.template()):
        best, nearest = 1e30, -1
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            j = neighbour[k]
            r = self.x[i] - self.x[j]
            if weight[k] > 0.0 and self.units[j] > 0 and not self._light(j) and r.norm_sqr() < best:
                best, nearest = r.norm_sqr(), j
        return nearest

    @ti.kernel
    def _join(self):
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            j = self.target[i]
            if j >= 0 and ti.cast(self.units[i] + self.units[j], ti.f64) <= HEAVY * self.full:
                both = self.units[i] + self.units[j]
                share = ti.cast(ti.cast(self.units[i], ti.f64) / ti.cast(both, ti.f64), float)
                self.v[j] += share * (self.v[i] - self.v[j])
                centre = self.x[j] + share * (self.x[i] - self.x[j])
                if not self.sides.crosses(self.x[j], centre):
                    self.x[j] = centre
                self.population.set_units(j, both)
                self.population.set_units(i, ti.cast(0, ti.i64))
