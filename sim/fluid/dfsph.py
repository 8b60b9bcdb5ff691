"""Divergence-free SPH: one pressure solve makes velocity right, another the way that particles go."""

import math

import taichi as ti

from sim import runtime
from sim.fluid.motion import Motion
from sim.fluid.mutual import Mutual
from sim.fluid.projection import Projection
from sim.registry import register
from sim.schema import Model, option, quantity
from sim.stage import Build, Limit, Stage
from sim.state import Row


@register("fluid.pressure", "dfsph")
@ti.data_oriented
class Dfsph:
    """Pressure so that no velocity compresses (D rho/Dt <= 0), and no way does (rho <= rho0).   Bender & Koschier 2017

    Pressure is kept as kappa = p/rho^2 [m^5/(kg s^2)]:  a_i = -sum_j m_j (kappa_i + kappa_j) grad W_ij, kappa >= 0.
    velocity   after all forces, v gains dt a so that nothing is compressed beyond rho0
    way        x moves by dt (v + dt a'), a' such that errors of density are gone at the step's end; v keeps of it what
               the water's spin needs (see Projection) and no more (the particle shift of Cornelis et al. 2018): taking
               errors back through v made still water simmer
    Each starts from the kappa of the step before. Water thinner than rho0 may close up: only the rest of a compression
    counts, so a ragged surface needs no exception.
    """

    class Params(Model):
        density_error: float = quantity(3e-4, ge=1e-5, le=0.05, why="mean compression that a step may end with")
        divergence_error: float = quantity(
            0.1, ge=1e-4, le=0.5, why="share of the compression that forces bring in a step which v may keep"
        )
        iterations_max: int = quantity(100, ge=1, le=100000, why="its residual ends it sooner, failure half later")
        cfl: float = quantity(0.4, gt=0, le=1, why="dt <= cfl spacing / max speed")
        warm_start: bool = option(True, why="starts from the last step's pressure")

    rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density", "fluid.acceleration", "fluid.pressure_acceleration")
    scratch = (
        Row("fluid.dfsph.kappa", "f", "m^5/(kg s^2)", "p/rho^2 of the velocity"),
        Row("fluid.dfsph.kappa_way", "f", "m^5/(kg s^2)", "the same, of the way beyond it"),
        Row("fluid.dfsph.diagonal", "f", "kg^2/m^8", "how much own kappa changes D rho/Dt", saved=False),
        Row("fluid.dfsph.guess", "f", "m^5/(kg s^2)", "kappa ahead of its iteration", saved=False),
    )

    def __init__(self, build: Build, params: Params, terms: tuple = ()):
        self.params = params
        self.state, self.pairs, self.walls = build.state, build.parts["pairs"], build.parts["walls"]
        self.x, self.v, self.mass, self.density, _, self.pressure_acceleration = (build.state[n] for n in self.rows)
        self.kappa, self.kappa_way, self.diagonal, self.guess = (build.state[row.name] for row in self.scratch)
        capacity = max(build.state.sizes["fluid"], 1)
        self.u = runtime.fours(capacity)
        self.support, self.spacing = build.config.fluid.support, build.config.fluid.spacing
        self.rest_density = build.config.fluid.liquid.rest_density
        met = (build.config.solid, build.config.cloth, build.config.space.periodic)
        self.free = not any(met)  # what water meets takes its spin, and periodic space knows none
        self.motion = Motion(build, terms, params.cfl, way=self.u)
        once = runtime.many(capacity, build.config.cloth is not None) and not build.config.space.periodic
        self.projection = Mutual(self) if once else Projection(self)
        self.iterations = {"velocity": 0, "way": 0}
        self.clock, self.bearable = build.parts["clock"], math.inf
        build.parts["pressure"] = self

    def stages(self) -> tuple[Stage, ...]:
        """density (prepare), forces (accelerate), pressure (solve), move (move)."""
        forces, move = self.motion.stages()
        reads = ("fluid.x", "fluid.v", "fluid.mass")
        return (
            Stage("density", "prepare", self.prepare, reads, ("fluid.density",)),
            forces,
            Stage("pressure", "solve", self.solve, reads, ("fluid.v", "fluid.pressure_acceleration"), self._of_solve),
            move,
        )

    def prepare(self, dt: float) -> None:
        """Density and diagonal."""
        self._measure(self.pairs.neighbour, self.pairs.weight, self.pairs.slope)

    def solve(self, dt: float) -> None:
        """Velocity, then way. One that failed for velocity halves the steps that are left of the frame."""
        self.iterations["velocity"], self.iterations["way"] = self.projection.solve(dt)
        if self.iterations["velocity"] > self.params.iterations_max:
            self.bearable = 0.5 * dt

    def _of_solve(self) -> Limit:
        """A frame begins without: a run that is resumed there knows no more."""
        if self.clock.elapsed == 0.0:
            self.bearable = math.inf
        return Limit(self.bearable, "failed solve")

    @ti.func
    def pressure(self, i):
        """p_i [Pa]."""
        return self.density[i] ** 2 * self.kappa[i]

    @ti.kernel
    def _measure(self, neighbour: ti.template(), weight: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            m = self.mass[i]
            place, rho = self.pairs.place[i], self.pairs.self_weight * m
            total, spread = ti.Vector([0.0, 0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0, 0.0])
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                j = neighbour[k]
                g = slope[k] * self.pairs.beyond(place, j)
                rho += weight[k]
                total += g
                spread += g * g * self.pairs.inverse_mass[j]
            self.density[i] = rho + self.walls.meet(i)
            self.u[i] = spread  # what is stored whole is summed whole
            self.diagonal[i] = (total.xyz + self.walls.gradient[i]).norm_sqr() + m * spread.xyz.sum()

    @ti.func
    def take(self, i, dt):
        """v from the solve; walls rub where they pushed."""
        u = self.u[i].xyz
        self.pressure_acceleration[i] = (u - self.v[i]) / dt
        if ti.static(self.walls.rough):
            u = self.walls.slow(i, u, dt * self.kappa[i] * self.walls.gradient[i].norm())
        self.v[i] = u
