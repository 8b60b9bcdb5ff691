"""The method of Mueller 2003, with which the 2019 report exploded and imploded: an ideal gas in small steps."""

import math

import taichi as ti

from sim import runtime
from sim.fluid.motion import Motion
from sim.maths.kernels import viscosity_laplacian
from sim.registry import register
from sim.schema import Model, option, quantity
from sim.stage import Build, Limit, Stage, Suspect
from sim.state import Row

CFL = 0.4
"""Spacings that the fastest particle may move in a step."""


@register("fluid.pressure", "mueller")
@ti.data_oriented
class Mueller:
    """Ideal gas, p = k (rho - rho0) [Pa], pushed by spiky, slowed by the viscosity kernel.   Mueller 2003, eq. 10-14

    a_i = sum_j m_j/(rho_i rho_j) (mu (v_j - v_i) lap W_ij - (p_i + p_j)/2 grad W_ij), mu = rho0 nu.
    The mean (p_i + p_j)/2 is half of the gradient inside the water (the p_i of a full neighbourhood cancel), so sound
    runs at sqrt(k/2) and pressure at rest is twice rho g h. On the lattice at H = 2 dx it is stable to 2.8 dx/sqrt(k)
    and 0.51 dx^2/nu; the limits below lie under both. Solids act with their own pressure 0, as in sim.fluid.walls.
    """

    class Params(Model):
        gas_constant: float = quantity("20 m^2/s^2", gt=0, why="k = c^2; c = 10 x the speed for 1 % compression")
        clamp_pressure: bool = option(True, why="p >= 0; the report's false lets thin water pull itself together")
        printed_viscosity_sign: bool = option(False, why="the report's (v_i - v_j) instead of Mueller's (v_j - v_i)")
        printed_normalisation: bool = option(False, why="the report's kernels; else a lattice has density rho0")
        mass_factor: float = quantity(1.0, gt=0, le=100, why="the report's guess of a particle's mass, over rho0 dx^3")

        @property
        def sound_speed(self) -> float:
            """c = sqrt(k) [m/s]."""
            return math.sqrt(self.gas_constant)

    rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density", "fluid.acceleration", "fluid.pressure_acceleration")
    scratch = (Row("fluid.mueller.pressure", "f", "Pa", "of the last sweep", saved=False),)

    def __init__(self, build: Build, params: Params, terms: tuple = ()):
        fluid = build.config.fluid
        self.params = params
        self.state, self.pairs, self.walls = build.state, build.parts["pairs"], build.parts["walls"]
        self.x, self.v, self.mass, self.density, _, self.pressure_acceleration = (build.state[n] for n in self.rows)
        self.p = build.state[self.scratch[0].name]
        self.rest_density, self.nu = fluid.liquid.rest_density, fluid.liquid.nu
        self.support_radius, self.h = fluid.support_radius, 0.5 * fluid.support_radius
        self.share = params.mass_factor * (1.0 / self.pairs.scale if params.printed_normalisation else 1.0)
        self.motion = Motion(build, terms, CFL)
        self.few = runtime.few(build.state.sizes["fluid"])
        build.parts["pressure"] = self

    def stages(self) -> tuple[Stage, ...]:
        """density (prepare), forces (accelerate), pressure (solve), move (move)."""
        forces, move = self.motion.stages()
        reads = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density")
        return (
            Stage("density", "prepare", self.prepare, reads[:3], ("fluid.density",), self._limit),
            forces,
            Stage("pressure", "solve", self.solve, reads, ("fluid.v", "fluid.pressure_acceleration")),
            move,
        )

    def prepare(self, dt: float) -> None:
        """Density, and pressure from it."""
        params = self.params
        floor = 0.0 if params.clamp_pressure else -math.inf
        self._measure(self.pairs.weight, params.gas_constant, floor, self.share, params.mass_factor)

    def solve(self, dt: float) -> None:
        """v += dt times the acceleration of pressure and viscosity."""
        mu = self.rest_density * self.nu * (-1.0 if self.params.printed_viscosity_sign else 1.0)
        self._push(dt, mu, self.share, self.pairs.neighbour, self.pairs.weight, self.pairs.slope)

    def suspects(self) -> tuple[Suspect, ...]:
        """Settings that are known to fail, for the guard."""
        params, found, key = self.params, [], "fluid.mueller."
        if params.printed_viscosity_sign:
            found.append(Suspect("exploding", f"{key}printed_viscosity_sign = true adds energy, set it to false"))
        if params.mass_factor != 1.0:
            failure = "exploding" if params.mass_factor > 1.0 else "imploding"
            found.append(Suspect(failure, f"{key}mass_factor = {params.mass_factor:g} misreads density, set it to 1"))
        if not params.clamp_pressure:
            found.append(Suspect("imploding", f"{key}clamp_pressure = false lets pressure pull, set it to true"))
        return tuple(found)

    def _limit(self) -> Limit:
        """0.25 h/(c + U), 0.125 h^2/nu, 0.25 sqrt(h/|a|), h = H/2, c = sqrt(k).   Monaghan 1992, Morris 1997"""
        acceleration = self._strongest()
        sound = Limit(0.25 * self.h / (self.params.sound_speed + self.motion.fastest()), "sound speed")
        viscosity = Limit(0.125 * self.h**2 / self.nu if self.nu else math.inf, "viscosity")
        push = Limit(0.25 * math.sqrt(self.h / acceleration) if acceleration else math.inf, "acceleration")
        return min(sound, viscosity, push)

    @ti.func
    def pressure(self, i):
        """p_i [Pa]."""
        return self.p[i]

    @ti.kernel
    def _measure(self, weight: ti.template(), k: float, floor: float, share: float, mass_factor: float):
        for i in range(self.state.count[None]):
            rho = share * self.pairs.self_weight * self.mass[i] + mass_factor * self.walls.meet(i)
            for n in range(self.pairs.start[i], self.pairs.stop[i]):
                rho += share * weight[n]
            self.density[i], self.p[i] = rho, ti.max(k * (rho - self.rest_density), floor)

    @ti.kernel
    def _push(
        self,
        dt: float,
        mu: float,
        share: float,
        neighbour: ti.template(),
        weight: ti.template(),
        slope: ti.template(),
    ):
        for i in range(self.state.count[None]):
            x, v, rho, own = self.x[i], self.v[i], self.density[i], self.p[i]
            a = -0.5 * own / (rho * self.rest_density) * self.walls.gradient[i]
            for n in range(self.pairs.start[i], self.pairs.stop[i]):
                if weight[n] > 0.0:
                    j = neighbour[n]
                    r = self.pairs.apart(x, j)
                    spread = self.pairs.scale * self.mass[j] * viscosity_laplacian(r.norm(), self.support_radius)
                    force = mu * spread * (self.v[j] - v) - 0.5 * (own + self.p[j]) * slope[n] * r
                    a += share / (rho * self.density[j]) * force
            self.pressure_acceleration[i] = a
        for i in range(self.state.count[None]):
            v = self.v[i] + dt * self.pressure_acceleration[i]
            if ti.static(self.walls.rough):
                push = 0.5 * self.p[i] / (self.density[i] * self.rest_density) * self.walls.gradient[i].norm()
                v = self.walls.slow(i, v, dt * push)
            self.v[i] = v

    @ti.kernel
    def _strongest(self) -> float:
        """max |a| [m/s^2] of gravity, pressure and viscosity in the last step."""
        strongest = 0.0
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            ti.atomic_max(strongest, (self.motion.gravity + self.pressure_acceleration[i]).norm_sqr())
        return ti.sqrt(strongest)
