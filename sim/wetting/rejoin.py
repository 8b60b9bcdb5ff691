"""Rejoin: film that touches water under the sheet is part of that water again."""

import taichi as ti

from sim.stage import Build, Stage
from sim.wetting.merge import HEAVY


@ti.data_oriented
class Rejoin:
    """Below a sheet under water no drop finds room to fall. A particle that touches the sheet from below takes the film
    of the patch over it, with its momentum, until it is as heavy as a particle may be."""

    def __init__(self, build: Build):
        state = build.state
        self.water, self.supply = build.parts["cloth_water"], build.parts["supply"]
        self.population = build.parts["population"]
        self.state_count, self.triangle = state.count, state["fluid.triangle"]
        self.v, self.units = state["fluid.v"], state["fluid.mass_units"]
        self.most = int(HEAVY * build.scene.water.units)

    def stages(self) -> tuple[Stage, ...]:
        """One, before drops are let go: `touch` of this step knows who touches."""
        reads = ("fluid.triangle", "fluid.v", "fluid.mass_units", "patch.film")
        writes = ("fluid.v", "fluid.mass", "fluid.mass_units", "patch.film")
        return (Stage("wetting.rejoin", "wet", self.run, reads=reads, writes=writes),)

    @ti.kernel
    def run(self, dt: float):
        """In row order, so that it is the same on any number of threads."""
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            face, p, units = self.supply.face[i], self.triangle[i] // 2, self.units[i]
            if face >= 0 and units > 0:
                outwards = self.water.normal[p].dot(self.water.gravity) * (1.0 if face == 0 else -1.0)
                taken = ti.min(self.water.film[p], ti.i64(self.most) - units)
                if outwards > 0.0 and taken > 0:
                    share = ti.cast(ti.cast(taken, ti.f64) / ti.cast(units + taken, ti.f64), float)
                    self.v[i] += share * (self.water.velocity[p] - self.v[i])
                    self.population.set_units(i, units + taken)
                    self.water.film[p] -= taken
                    self.water.carry(p, -taken, self.water.velocity[p])
