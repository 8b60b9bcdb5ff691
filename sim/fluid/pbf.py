"""Position based fluids: density made right by moving particles, a set number of times a step."""

import math
from typing import Any

import taichi as ti

from sim.crew import Crew, Lists, blocks, rows
from sim.errors import CapacityError
from sim.fluid.motion import Motion
from sim.maths.kernels import largest_eigenvalue, lattice_diagonal
from sim.registry import register
from sim.schema import Model, quantity
from sim.stage import Build, Limit, Stage
from sim.state import Row

BEGIN, MEASURE, SHIFT, FINISH = range(4)
"""Phases of the work."""
SAFETY = 0.6
"""Of Jacobi's largest step on the lattice: disordered water and surfaces bear less."""
TOGETHER = 1e-6
"""[1] Pairs that began so much nearer than they are (squared) have no line to be pushed along."""
DEPTH = 10
"""Spacings of water that a step must bear, whatever the scene's blocks."""


@register("fluid.pressure", "pbf")
@ti.data_oriented
class Pbf:
    """rho(x + s) <= rho0: s_i -= dt^2 sum_j m_j (kappa_i + kappa_j) grad W_ij, v = s/dt.   Macklin & Mueller 2013

    Their constraint C = rho/rho0 - 1 and its multiplier, here as kappa = p/rho^2 [m^5/(kg s^2)], summed over iterations
    and kept >= 0 as a sum. Each adds (rho - rho0)/(dt^2 (D + epsilon)), D = |sum_j m_j grad W|^2 + m_i sum_j m_j |grad
    W|^2 (their eq. 9), with W at x + s over the pairs of the step's start, and runs ahead by Nesterov's momentum
    (O'Donoghue & Candes 2015). epsilon (their eq. 11) is a share of the lattice's D. Their eq. 13 (against clumping)
    is not needed: nothing pulls. s is kept apart from x, so that v = s/dt has digits. grad W is taken along the line on
    which the pair began the step: sum m x cross s/dt asks for x as it was, so spin is kept to rounding.

    From no pressure in a few iterations, water is as soft as if sound went through it at c = (dx/dt) sqrt(n/L), L =
    D (1 + epsilon/D) dx^2/rho0^2 on the lattice: under a pressure p it gives way by p/(rho0 c^2), calmly.
    A start from the last step's pressure halves that, and makes still water boil at 8 cm/s: an error's integral
    drives what integrates twice, so it is only stable where iteration converges, which is what dfsph does.
    """

    class Params(Model):
        iterations: int = quantity(3, ge=1, le=100, why="fixed; more, or smaller steps, where water is deep")
        relaxation: float | None = quantity(
            None, gt=0, why="epsilon over the lattice's diagonal; absent = what Jacobi's iteration needs"
        )
        compression: float = quantity(0.05, gt=0, le=0.2, why="at the foot of the scene's highest block; dt follows")
        cfl: float = quantity(0.4, gt=0, le=1, why="dt <= cfl spacing / max speed")

    rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.density", "fluid.acceleration", "fluid.pressure_acceleration")
    scratch = (
        Row("fluid.pbf.kappa", "f", "m^5/(kg s^2)", "p/rho^2", saved=False),
        Row("fluid.pbf.change", "f", "m^5/(kg s^2)", "of kappa in an iteration", saved=False),
        Row("fluid.pbf.ahead", "f", "m^5/(kg s^2)", "kappa ahead of its iteration", saved=False),
        Row("fluid.pbf.wall", "f", "kg/m^3", "walls' density at x + s, less gradient . s", saved=False),
        Row("fluid.pbf.shift", "v", "m", "s: where the particle goes, from where it is", saved=False),
    )

    def __init__(self, build: Build, params: Params, terms: tuple = ()):
        fluid = build.config.fluid
        self.params = params
        self.state, self.pairs, self.walls = build.state, build.parts["pairs"], build.parts["walls"]
        self.x, self.v, self.mass, self.density, _, self.pressure_acceleration = (build.state[n] for n in self.rows)
        self.kappa, self.change, self.ahead, self.wall, self.shift = (build.state[row.name] for row in self.scratch)
        self.rest_density, self.spacing = fluid.liquid.rest_density, fluid.spacing
        self.kernel, self.support_radius = self.pairs.kernel, fluid.support_radius
        share = params.relaxation
        if share is None:
            share = largest_eigenvalue(self.kernel, fluid.support) / (2.0 * SAFETY) - 1.0
        lattice = lattice_diagonal(self.kernel, fluid.support) * self.rest_density**2 / self.spacing**2
        self.epsilon = share * lattice
        self.softest = self._softest(build.config, (1.0 + share) * lattice_diagonal(self.kernel, fluid.support))
        self.motion = Motion(build, terms, params.cfl)
        self.crew = Crew()
        self.phase, self.done = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.last = params.iterations - 1
        self.lists = None  # gradient: m_j grad W of each pair at x + s, along its line [kg/m^4]
        self.iterations = {"density": params.iterations}
        build.parts["pressure"] = self

    def stages(self) -> tuple[Stage, ...]:
        """forces (accelerate), pressure (solve), move (move)."""
        forces, move = self.motion.stages()
        reads = ("fluid.x", "fluid.v", "fluid.mass")
        changed = ("fluid.v", "fluid.density", "fluid.pressure_acceleration")
        return forces, Stage("pressure", "solve", self.solve, reads, changed, self._of_softness), move

    def solve(self, dt: float) -> None:
        """v such that the density at x + dt v is at most rho0, as far as the iterations get."""
        neighbour, weight = self.pairs.neighbour, self.pairs.weight
        if self.lists is None or self.lists.weight is not weight:
            try:
                gradient = ti.Vector.field(3, float, shape=weight.shape)
            except RuntimeError as error:
                raise CapacityError(f"fluid: no memory for {weight.shape[0]} pairs; use a larger spacing") from error
            self.lists = Lists(neighbour=neighbour, weight=weight, gradient=gradient)
        self.crew.run(self, dt, self.lists)

    def _softest(self, config: Any, stiffness: float) -> float:
        """dt [s] at which the highest block, or DEPTH spacings of water, compress their foot by `compression`."""
        gravity, dx = config.space.gravity, self.spacing
        heads = [sum(abs(g) * (b - a) for g, a, b in zip(gravity, o.low, o.high)) for o in config.fluid.block.values()]
        head = max([*heads, DEPTH * dx * math.hypot(*gravity), 1e-30])
        return dx * math.sqrt(self.params.compression * self.params.iterations / (stiffness * head))

    def _of_softness(self) -> Limit:
        """dt <= dx sqrt(compression n/(L g depth)), from p = rho0 g depth = rho0 c^2 compression."""
        return Limit(self.softest, "softness")

    @ti.func
    def pressure(self, i):
        """p_i [Pa]."""
        return self.density[i] ** 2 * self.kappa[i]

    @ti.func
    def begin(self):
        """Before the first phase."""
        self.phase[None], self.done[None] = BEGIN, 0

    @ti.func
    def count(self):
        """Rows."""
        return self.state.count[None]

    @ti.func
    def tasks(self):
        """Blocks of rows, in every phase."""
        return blocks(self.state.count[None])

    @ti.func
    def work(self, task, dt, lists: ti.template()):
        """A block's share of the phase."""
        phase, n = self.phase[None], self.done[None]
        momentum = n / (n + 3.0) if n < self.last else 0.0
        first, end = rows(task, self.state.count[None])
        for i in range(first, end):
            if phase == MEASURE:
                self._measure(i, dt, momentum, lists)
            elif phase == SHIFT:
                self._shift(i, dt, lists)
            elif phase == BEGIN:
                self._begin(i, dt)
            else:
                self._finish(i, dt)

    @ti.func
    def decide(self):
        """BEGIN, (MEASURE, SHIFT) as often as asked, FINISH."""
        phase = self.phase[None]
        if phase == SHIFT:
            self.phase[None] = MEASURE if self.done[None] < self.last else FINISH
            self.done[None] += 1
        else:
            self.phase[None] = phase + 1
        return phase != FINISH

    @ti.func
    def _begin(self, i, dt):
        """s = dt v; walls are met once, where that leads, and followed by their gradient: they are dear and smooth."""
        s = dt * self.v[i]
        rho = self.walls.meet_at(i, self.x[i] + s)
        # `rate` of one that rests is what moving walls bring.
        self.wall[i] = rho - self.walls.gradient[i].dot(s) + dt * self.walls.rate(i, 0.0 * s)
        self.kappa[i], self.ahead[i], self.shift[i] = 0.0, 0.0, s

    @ti.func
    def _measure(self, i, dt, momentum, lists: ti.template()):
        """Density, gradients and the change of kappa at x + s. A pair without weight was cut and stays so."""
        m, x, s = self.mass[i], self.x[i], self.shift[i]
        total = self.walls.gradient[i]
        rho, spread = self.pairs.self_weight * m + self.wall[i] + total.dot(s), 0.0
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            j = lists.neighbour[k]
            line = self.pairs.apart(x, j)
            r = line + (s - self.shift[j])
            distance, size = r.norm(), line.norm_sqr()
            share = ti.select(lists.weight[k] > 0.0, self.pairs.scale * self.mass[j], 0.0)
            if size > TOGETHER * distance * distance:
                r = r.dot(line) / size * line
            g = share * self.kernel.slope(distance, self.support_radius) * r
            rho += share * self.kernel.value(distance, self.support_radius)
            spread += g.norm_sqr() * self.pairs.inverse_mass[j]
            total += g
            lists.gradient[k] = g
        old, guess = self.kappa[i], self.ahead[i]
        lack = dt * dt * (total.norm_sqr() + m * spread + self.epsilon)
        new = ti.max(guess + (rho - self.rest_density) / lack, 0.0)
        ahead = ti.max(new + momentum * (new - old), 0.0)
        self.density[i], self.kappa[i], self.ahead[i], self.change[i] = rho, new, ahead, ahead - guess

    @ti.func
    def _shift(self, i, dt, lists: ti.template()):
        own = self.change[i]
        push = own * self.walls.gradient[i]
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            push += (own + self.change[lists.neighbour[k]]) * lists.gradient[k]
        self.shift[i] -= dt * dt * push

    @ti.func
    def _finish(self, i, dt):
        """v = s/dt; walls rub where they pushed."""
        u = self.shift[i] / dt
        self.pressure_acceleration[i] = (u - self.v[i]) / dt
        if ti.static(self.walls.rough):
            u = self.walls.slow(i, u, dt * self.kappa[i] * self.walls.gradient[i].norm())
        self.v[i] = u
