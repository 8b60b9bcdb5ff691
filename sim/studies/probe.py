"""What studies read off the water of a world, whatever its method."""

import numpy as np
import taichi as ti


def row(world, name: str) -> np.ndarray:
    """A fluid row of the living particles, f64: (n,) or (n, 3)."""
    return world.state[f"fluid.{name}"].to_numpy()[: world.state.count[None]].astype(np.float64)


@ti.data_oriented
class Pressure:
    """Pressure of each particle by the method's own `pressure(i)`, its force on solids, and what stress it stands for.

    The mean stress of particles that push each other by a_i = -sum_j m_j (kappa_i + kappa_j) grad W_ij, all of one
    kappa = p/rho^2, is not p: it is p times response = -sum_j m_j r_ij . grad W_ij/(3 rho_i), by which a change of
    volume changes the density sum. Response would be 1 if sums were integrals; W(0), which no strain changes, lowers it
    (Wendland C2, settled water: about 0.95 at support 2, 0.99 at 3).
    """

    def __init__(self, world):
        self.state, self.mass, self.x = world.state, world.state["fluid.mass"], world.state["fluid.x"]
        parts = world.build.parts
        self.part, self.walls, self.pairs = parts["pressure"], parts["walls"], parts["pairs"]
        self.density = world.state["fluid.density"]
        self.p = ti.field(float, shape=self.mass.shape)
        self.push = ti.Vector.field(3, float, shape=self.mass.shape)

    def read(self) -> np.ndarray:
        """p_i [Pa], (n,), by the method."""
        self._read()
        return self._living(self.p)

    def on_solids(self) -> np.ndarray:
        """Force of the pressure last read on all solids [N], (3,): sum of m_i p_i/rho_i^2 rho0 grad lambda_i."""
        return self._living(self.push).sum(0)

    def response(self) -> np.ndarray:
        """-sum_j m_j r_ij . grad W_ij/(3 rho_i), (n,): too small within reach of solids and of the surface."""
        self._respond(self.pairs.neighbour, self.pairs.slope)
        return self._living(self.p)

    def _living(self, rows) -> np.ndarray:
        return rows.to_numpy()[: self.state.count[None]].astype(np.float64)

    @ti.kernel
    def _read(self):
        for i in range(self.state.count[None]):
            self.p[i] = self.part.pressure(i)
            self.push[i] = self.mass[i] * self.p[i] / self.density[i] ** 2 * self.walls.gradient[i]

    @ti.kernel
    def _respond(self, neighbour: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            total = 0.0
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                total -= slope[k] * self.pairs.apart(self.x[i], neighbour[k]).norm_sqr()
            self.p[i] = total / (3.0 * self.density[i])
