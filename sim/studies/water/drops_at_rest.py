"""Drops at rest: the surface tension that their inner pressure shows."""

import numpy as np
import taichi as ti

from sim.studies.case import Case, Point
from sim.studies.probe import row

SETTLED = 0.5
"""[1] of the run: stress is a mean over what is left."""


@ti.data_oriented
class Stress:
    """Mean normal stress of each particle [Pa]: rho0/3 (|v|^2 + 1/2 sum_j a_ij . r_ij), by pressure and all terms.

    What Irving & Kirkwood 1950 count: half of each pair's force times its distance, and what motion carries.
    """

    def __init__(self, world):
        parts = world.build.parts
        self.pressure, self.pairs, self.state = parts["pressure"], parts["pairs"], world.state
        self.terms = self.pressure.motion.terms
        self.x, self.v, self.density = (world.state[f"fluid.{n}"] for n in ("x", "v", "density"))
        self.rest_density = world.config.fluid.liquid.rest_density
        self.out = ti.field(float, shape=self.density.shape)

    def read(self) -> np.ndarray:
        """Of each living particle, (n,)."""
        self._read(self.pairs.neighbour, self.pairs.gradient)
        return self.out.to_numpy()[: self.state.count[None]].astype(float)

    @ti.kernel
    def _read(self, neighbour: ti.template(), gradient: ti.template()):
        for i in range(self.state.count[None]):
            total = 2.0 * self.v[i].norm_sqr()
            own = self.pressure.pressure(i) / self.density[i] ** 2
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                j = neighbour[k]
                r = self.pairs.apart(self.x[i], j)
                a = -(own + self.pressure.pressure(j) / self.density[j] ** 2) * gradient[k]
                for term in ti.static(self.terms):
                    a += term.acceleration(i, j, r, gradient[k])
                total += a.dot(r)
            self.out[i] = self.rest_density / 6.0 * total


def measure(world) -> dict[str, float]:
    """gamma [N/m] from the slope of inner stress against 2/R, R the mean radius at which tension acts (Gibbs 1878).

    error         gamma over the liquid's, less 1
    error_at_rim  the same with the radius of the ball that the drop's water fills
    drift         the largest speed of a drop's centre of mass [m/s]: nothing pulls it
    NAME          mean stress deeper than H below the surface of that drop, over 2 gamma/R
    """
    balls, liquid = world.config.fluid.ball, world.config.fluid.liquid
    counts = [round(ball.volume / world.config.fluid.spacing**3) for ball in balls.values()]
    drop_of = np.repeat(np.arange(len(balls)), counts)
    rims = np.array([ball.radius for ball in balls.values()])
    stress, seen = Stress(world), []
    while world.clock.time < world.config.run.duration - 1e-9:
        world.step()
        if world.clock.time > SETTLED * world.config.run.duration:
            seen.append(_read(world, stress.read(), drop_of, rims))
    inner, radii = np.mean(seen, axis=0)
    gamma, at_rim = (np.polyfit(2.0 / r, inner, 1)[0] for r in (radii, rims))
    ids, v = row(world, "id").astype(int), row(world, "v")
    drift = max(np.linalg.norm(v[drop_of[ids] == k].mean(0)) for k in range(len(balls)))
    shares = dict(zip(balls, (inner * radii / (2.0 * liquid.surface_tension)).tolist()))
    return {
        "error": gamma / liquid.surface_tension - 1.0,
        "error_at_rim": at_rim / liquid.surface_tension - 1.0,
        "drift": drift,
        **shares,
    }


def _read(world, stress: np.ndarray, drop_of: np.ndarray, rims: np.ndarray) -> np.ndarray:
    """(2, drops): mean stress deeper than H below the rim [Pa], mean radius of the tension's stress [m]."""
    x, drop = row(world, "x"), drop_of[row(world, "id").astype(int)]
    pull = np.linalg.norm(row(world, "surface_tension.pull"), axis=1)
    found = []
    for k, rim in enumerate(rims):
        mine = drop == k
        r = np.linalg.norm(x[mine] - x[mine].mean(0), axis=1)
        found.append(
            (stress[mine][r < rim - world.config.fluid.support_radius].mean(), np.average(r, weights=pull[mine]))
        )
    return np.transpose(found)


CASE = Case(
    name="drops_at_rest",
    scene="drops_at_rest",
    reference="Laplace 1805: p = 2 gamma/R",
    bounds={"error": 0.15},
    measure=measure,
    full=(Point(),),
    quick=(),
)
