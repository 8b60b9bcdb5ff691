"""Weakly compressible SPH: pressure straight from density, in small steps."""

from typing import Self

import taichi as ti

from sim.fluid.motion import Motion
from sim.registry import register
from sim.schema import Model, quantity
from sim.stage import Build, Limit, Stage
from sim.state import Row

GAMMA = 7
"""Tait's exponent for water."""
SOUND = 10.0
"""[1] Times the expected speed."""


@register("fluid.pressure", "wcsph")
@ti.data_oriented
class Wcsph:
    """Pressure from the Tait equation, p = rho0 c^2/7 ((rho/rho0)^7 - 1) >= 0  [Pa].   Becker & Teschner 2007, eq. 7

    a_i = -sum_j m_j (p_i/rho_i^2 + p_j/rho_j^2 + Pi_ij) grad W_ij, with Pi_ij = -alpha h c (v.r)/(r^2 + 0.01 h^2)/rho0
    where neighbours approach (their eq. 10), which the sound that a stiff liquid makes needs. Symplectic Euler.
    """

    class Params(Model):
        sound_speed: float | None = quantity(None, "speed", gt=0, why="absent = 10 x fluid.expected_speed")
        alpha: float = quantity(0.08, ge=0, le=1, why="artificial viscosity; 0.08 to 0.5 in Becker & Teschner")
        cfl: float = quantity(0.4, gt=0, le=1, why="dt <= cfl spacing / max speed")

        def follow(self, fluid) -> Self:
            """The speed of sound where the scene gives none: water at U is then compressed by (U/c)^2 = 1 %."""
            return self.model_copy(update={"sound_speed": self.sound_speed or SOUND * fluid.expected_speed})

        def sound_limit(self, fluid) -> Limit:
            """dt <= 0.4 h/(c (1 + 0.6 alpha)), h = H/2, at rest; speed has its own.   Monaghan 1992"""
            speed = self.sound_speed * (1.0 + 0.6 * self.alpha)
            return Limit(0.4 * 0.5 * fluid.support_radius / speed, "sound speed")

    rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density", "fluid.acceleration", "fluid.pressure_acceleration")
    scratch = (Row("fluid.wcsph.kappa", "f", "m^5/(kg s^2)", "p/rho^2", saved=False),)

    def __init__(self, build: Build, params: Params, terms: tuple = ()):
        fluid = build.config.fluid
        self.params = params
        self.state, self.pairs, self.walls = build.state, build.parts["pairs"], build.parts["walls"]
        self.x, self.v, self.mass, self.density, _, self.pressure_acceleration = (build.state[n] for n in self.rows)
        self.kappa = build.state["fluid.wcsph.kappa"]
        self.rest_density = fluid.liquid.rest_density
        self.sound_limit = params.sound_limit(fluid)
        self.h = 0.5 * fluid.support_radius
        self.stiffness = self.rest_density * params.sound_speed**2 / GAMMA
        self.damping = params.alpha * self.h * params.sound_speed / self.rest_density
        self.motion = Motion(build, terms, params.cfl)
        self.iterations = {}
        build.parts["pressure"] = self

    def stages(self) -> tuple[Stage, ...]:
        """density (prepare), forces (accelerate), pressure (solve), move (move)."""
        forces, move = self.motion.stages()
        reads = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density")
        return (
            Stage("density", "prepare", self.prepare, reads[:3], ("fluid.density",), lambda: self.sound_limit),
            forces,
            Stage("pressure", "solve", self.solve, reads, ("fluid.v", "fluid.pressure_acceleration")),
            move,
        )

    def prepare(self, dt: float) -> None:
        """Density, and pressure from it."""
        self._measure(self.pairs.weight)

    def solve(self, dt: float) -> None:
        """v += dt times the pressure's acceleration."""
        self._push(dt, self.pairs.neighbour, self.pairs.slope)

    @ti.func
    def pressure(self, i):
        """p_i [Pa]."""
        return self.density[i] ** 2 * self.kappa[i]

    @ti.kernel
    def _measure(self, weight: ti.template()):
        for i in range(self.state.count[None]):
            rho = self.pairs.self_weight * self.mass[i] + self.walls.meet(i)
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                rho += weight[k]
            pressure = self.stiffness * ti.max((rho / self.rest_density) ** GAMMA - 1.0, 0.0)
            self.density[i], self.kappa[i] = rho, pressure / (rho * rho)

    @ti.kernel
    def _push(self, dt: float, neighbour: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            x, v, own = self.x[i], self.v[i], self.kappa[i]
            a = -own * self.walls.gradient[i]
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                j = neighbour[k]
                r = self.pairs.apart(x, j)
                approach = ti.min((v - self.v[j]).dot(r), 0.0) / (r.norm_sqr() + 0.01 * self.h * self.h)
                a -= (own + self.kappa[j] - self.damping * approach) * slope[k] * r
            self.pressure_acceleration[i] = a
        for i in range(self.state.count[None]):
            v = self.v[i] + dt * self.pressure_acceleration[i]
            if ti.static(self.walls.rough):
                v = self.walls.slow(i, v, dt * self.kappa[i] * self.walls.gradient[i].norm())
            self.v[i] = v
