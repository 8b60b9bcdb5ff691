"""What water does to walls, as an instrument on them reads it."""

import numpy as np
import taichi as ti


@ti.data_oriented
class Gauge:
    """Forces of single particles on solids in the step just done, along the walls' normals: of their pressure,
    m_i p_i/rho_i^2 rho0 grad lambda_i, and of those that a wall had to stop. A sum of them over an area is a pressure.
    """

    def __init__(self, world):
        self.state = world.state
        self.method, self.walls = (world.build.parts[name] for name in ("pressure", "walls"))
        self.x, self.mass, self.density = (world.state[f"fluid.{name}"] for name in ("x", "mass", "density"))
        self.force = ti.Vector.field(3, float, shape=self.x.shape)

    def read(self, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """(x [m], F [N]), (n, 3) each; dt [s] of that step."""
        self._read(dt)
        living = self.state.count[None]
        return tuple(field.to_numpy()[:living].astype(np.float64) for field in (self.x, self.force))

    @ti.kernel
    def _read(self, dt: float):
        for i in range(self.state.count[None]):
            kappa = self.method.pressure(i) / self.density[i] ** 2
            self.force[i] = self.mass[i] * (kappa * self.walls.gradient[i] + self.walls.stopped[i] / dt)


def on_patch(x: np.ndarray, centre: np.ndarray, size: np.ndarray, spacing: float) -> np.ndarray:
    """Share (n,) of each particle's footprint, a square of side dx, that lies on a rectangle of a wall.

    x (n, 2): places along the wall; centre, size (2,) of the rectangle [m].
    """
    beyond = np.abs(x - centre)
    return np.clip((0.5 * (size + spacing) - beyond) / spacing, 0.0, np.minimum(1.0, size / spacing)).prod(1)


def depth(x: np.ndarray, centre: tuple[float, float], side: float, spacing: float) -> float:
    """Water in a square column over a point of the floor, as its depth: N dx^3/side^2 [m]. x (n, 3)."""
    inside = (np.abs(x[:, :2] - centre) < 0.5 * side).all(1)
    return float(inside.sum()) * spacing**3 / side**2
