"""Stress that water bears, of pressure and all terms; and what makes it a liquid."""

import numpy as np
import taichi as ti

STIRRED = 0.3
"""[m/s] Deviation of each component: a film or a drop that comes to rest from a lattice, or from shells, stays one, and
bears what no liquid would: stress in a drop of 8 spacings' radius came out 10 % higher. At 0.5 particles fly off."""


def stir(world) -> None:
    """Random velocities for all water, of no momentum."""
    field, count = world.state["fluid.v"], world.state.count[None]
    v, random = field.to_numpy(), np.random.default_rng(world.config.run.seed)
    u = random.normal(scale=STIRRED, size=(count, 3))
    v[:count] = u - u.mean(0)
    field.from_numpy(v)


@ti.data_oriented
class Stress:
    """rho0 (v v + 1/2 sum_j a_ij r_ij) of each particle along x, y, z [Pa]: what pushes is positive.

    What Irving & Kirkwood 1950 count: half of each pair's force times its distance, and what motion carries.
    """

    def __init__(self, world):
        parts = world.build.parts
        self.pressure, self.pairs, self.state = parts["pressure"], parts["pairs"], world.state
        self.terms = self.pressure.motion.terms
        self.x, self.v, self.density = (world.state[f"fluid.{n}"] for n in ("x", "v", "density"))
        self.rest_density = world.config.fluid.liquid.rest_density
        self.out = ti.Vector.field(3, float, shape=self.density.shape)

    def read(self) -> np.ndarray:
        """Of each living particle, (n, 3)."""
        self._read(self.pairs.neighbour, self.pairs.slope)
        return self.out.to_numpy()[: self.state.count[None]].astype(float)

    @ti.kernel
    def _read(self, neighbour: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            total = 2.0 * self.v[i] * self.v[i]
            own = self.pressure.pressure(i) / self.density[i] ** 2
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                j = neighbour[k]
                r = self.pairs.apart(self.x[i], j)
                a = -(own + self.pressure.pressure(j) / self.density[j] ** 2) * slope[k] * r
                for term in ti.static(self.terms):
                    a += term.acceleration(i, j, r, slope[k] * r)
                total += a * r
            self.out[i] = 0.5 * self.rest_density * total
