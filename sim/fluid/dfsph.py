"""Divergence-free SPH: two pressure solves a step make velocity, then density, right."""

import taichi as ti

from sim import runtime
from sim.fluid.motion import Motion
from sim.fluid.projection import Projection
from sim.registry import register
from sim.schema import Model, option, quantity
from sim.stage import Build, Stage
from sim.state import Row


@register("fluid.pressure", "dfsph")
@ti.data_oriented
class Dfsph:
    """Pressure so that D rho/Dt = 0 (before forces) and rho <= rho0 (after them).   Bender & Koschier 2017

    Pressure is kept as kappa = p/rho^2 [m^5/(kg s^2)]:  a_i = -sum_j m_j (kappa_i + kappa_j) grad W_ij.
    A solve for kappa >= 0 ends when the mean of what it would still correct, over and under, is below the tolerance;
    it starts from the kappa of the step before. Water that is thinner than rho0 may close up: only the rest of a
    compression counts as divergence, so a ragged surface needs no exception.
    """

    class Params(Model):
        density_error: float = quantity(
            3e-4, ge=1e-5, le=0.05, why="mean of what iteration leaves; at 0.001 a pool simmers"
        )
        divergence_error: float = quantity(0.001, ge=1e-5, le=0.05, why="the same of compression within one step")
        iterations_max: int = quantity(100, ge=1, why="a cap; the residual ends it sooner")
        cfl: float = quantity(0.4, gt=0, le=1, why="dt <= cfl spacing / max speed")
        warm_start: bool = option(True, why="starts from the last step's pressure")

    rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density", "fluid.acceleration", "fluid.pressure_acceleration")
    scratch = (
        Row("fluid.dfsph.kappa", "f", "m^5/(kg s^2)", "p/rho^2 of the density solve"),
        Row("fluid.dfsph.kappa_divergence", "f", "m^5/(kg s^2)", "p/rho^2 of the divergence solve"),
        Row("fluid.dfsph.diagonal", "f", "kg^2/m^8", "how much own kappa changes D rho/Dt", saved=False),
        Row("fluid.dfsph.guess", "f", "m^5/(kg s^2)", "kappa ahead of its iteration", saved=False),
        Row("fluid.dfsph.velocity", "v", "m/s", "v + dt a of the solve under way", saved=False),
    )

    def __init__(self, build: Build, params: Params, terms: tuple = ()):
        self.params = params
        self.state, self.pairs, self.walls = build.state, build.parts["pairs"], build.parts["walls"]
        self.x, self.v, self.mass, self.density, _, self.pressure_acceleration = (build.state[n] for n in self.rows)
        self.kappa, self.kappa_divergence, self.diagonal, self.guess, self.u = (
            build.state[row.name] for row in self.scratch
        )
        self.support = build.config.fluid.support
        self.rest_density = build.config.fluid.liquid.rest_density
        self.motion = Motion(build, terms, params.cfl)
        self.projection = Projection(self)
        self.few = runtime.few(build.state.sizes["fluid"])
        self.iterations = {"density": 0, "divergence": 0}
        build.parts["pressure"] = self

    def stages(self) -> tuple[Stage, ...]:
        """divergence (prepare), forces (accelerate), pressure (solve), move (move)."""
        forces, move = self.motion.stages()
        reads = ("fluid.x", "fluid.v", "fluid.mass")
        return (
            Stage("divergence", "prepare", self.prepare, reads, ("fluid.density", "fluid.v")),
            forces,
            Stage("pressure", "solve", self.solve, reads, ("fluid.v", "fluid.pressure_acceleration")),
            move,
        )

    def prepare(self, dt: float) -> None:
        """Density and diagonal; then v without compression beyond rho0."""
        self._measure(self.pairs.neighbour, self.pairs.weight, self.pairs.gradient)
        p = self.params
        self.iterations["divergence"] = self.projection.solve(
            self.kappa_divergence, dt, p.divergence_error, p.iterations_max, 0.0
        )
        self._take()

    def solve(self, dt: float) -> None:
        """v such that density errors are gone after max(dt, CORRECTION_TIME)."""
        p = self.params
        self.iterations["density"] = self.projection.solve(self.kappa, dt, p.density_error, p.iterations_max, 1.0)
        self._finish(dt)

    @ti.func
    def pressure(self, i):
        """p_i of both solves [Pa]."""
        return self.density[i] ** 2 * (self.kappa[i] + self.kappa_divergence[i])

    @ti.kernel
    def _measure(self, neighbour: ti.template(), weight: ti.template(), gradient: ti.template()):
        for i in range(self.state.count[None]):
            m = self.mass[i]
            rho, spread = self.pairs.self_weight * m, 0.0
            total = ti.Vector([0.0, 0.0, 0.0])
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                rho += weight[k]
                total += gradient[k]
                spread += gradient[k].norm_sqr() * self.pairs.inverse_mass[neighbour[k]]
            self.density[i] = rho + self.walls.meet(i)
            self.diagonal[i] = (total + self.walls.gradient[i]).norm_sqr() + m * spread

    @ti.kernel
    def _take(self):
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            self.v[i] = self.u[i]

    @ti.kernel
    def _finish(self, dt: float):
        """v from the solve; walls rub where they pushed."""
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            u = self.u[i]
            self.pressure_acceleration[i] = (u - self.v[i]) / dt
            if ti.static(self.walls.rough):
                u = self.walls.slow(i, u, dt * self.kappa[i] * self.walls.gradient[i].norm())
            self.v[i] = u
