"""What studies read off the water of a world, whatever its method."""

import numpy as np
import taichi as ti


def row(world, name: str) -> np.ndarray:
    """A fluid row of the living particles, f64: (n,) or (n, 3)."""
    return world.state[f"fluid.{name}"].to_numpy()[: world.state.count[None]].astype(np.float64)


@ti.data_oriented
class Pressure:
    """Pressure of each particle and the force on solids, by the method's own `pressure(i)`."""

    def __init__(self, world):
        self.state, self.mass = world.state, world.state["fluid.mass"]
        self.part, self.walls = world.build.parts["pressure"], world.build.parts["walls"]
        self.density = world.state["fluid.density"]
        self.p = ti.field(float, shape=world.state["fluid.mass"].shape)
        self.push = ti.Vector.field(3, float, shape=self.p.shape)

    def read(self) -> np.ndarray:
        """p_i [Pa], (n,)."""
        self._read()
        return self.p.to_numpy()[: self.state.count[None]].astype(np.float64)

    def on_solids(self) -> np.ndarray:
        """Force of the water's pressure on all solids [N], (3,): sum of m_i p_i/rho_i^2 rho0 grad lambda_i."""
        self._read()
        return self.push.to_numpy()[: self.state.count[None]].astype(np.float64).sum(0)

    @ti.kernel
    def _read(self):
        for i in range(self.state.count[None]):
            self.p[i] = self.part.pressure(i)
            self.push[i] = self.mass[i] * self.p[i] / self.density[i] ** 2 * self.walls.gradient[i]
