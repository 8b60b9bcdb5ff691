"""Viscosity of thick liquids, at the speed that it leaves behind: no step is too long for it."""

import math

import taichi as ti

from sim import runtime
from sim.errors import CapacityError
from sim.fluid.terms.wall_viscosity import WallViscosity
from sim.registry import register
from sim.runtime import TURNS
from sim.schema import Model, quantity
from sim.stage import Build, Stage
from sim.state import Row

BLOCK = 1024
"""Particles in one partial sum; see sim.fluid.projection."""


@register("fluid.term", "implicit_viscosity")
@ti.data_oriented
class ImplicitViscosity:
    """v_i = v*_i + dt sum_j 10 nu m_j/rho0 (v_ij . r)/(r^2 + 0.01 h^2) grad W_ij, h = H/2.   Weiler 2018, eq. 13

    v* has gravity and the pressure of the step before, which is taken out again: honey at rest is not sheared. The
    system, symmetric by mass, is solved by conjugate gradients with each particle's own 3 x 3 block inverted ahead. Its
    forces are central and taken once more from the solution: momentum and spin hold to rounding however far it got.
    Solids with no_slip hold it (see WallViscosity). A thread turns freely, as the form of Morris 1997 (see
    viscosity) does not let it; in return nu comes out at 0.85 in
    settled liquid at support 2, 0.97 at 3. Bounds no step.
    """

    class Params(Model):
        error: float = quantity(1e-3, ge=1e-6, le=0.1, why="rms velocity left to change, over the rms velocity")
        iterations_max: int = quantity(200, ge=1, why="a cap; the residual ends it sooner")

    rows = ("fluid.x", "fluid.v", "fluid.mass", "fluid.acceleration", "fluid.pressure_acceleration")
    scratch = (
        Row("fluid.implicit_viscosity.change", "v", "m/s^2", "acceleration by it in the last step"),
        Row("fluid.implicit_viscosity.grip", "f", "1", "dt times the rate of drag on solids that hold", saved=False),
        Row("fluid.implicit_viscosity.goal", "v", "m/s", "v*, and what solids that slide add to it", saved=False),
        Row("fluid.implicit_viscosity.u", "v", "m/s", "solution under way", saved=False),
        Row("fluid.implicit_viscosity.left", "v", "m/s", "v* - A u", saved=False),
        Row("fluid.implicit_viscosity.way", "v", "m/s", "of the search", saved=False),
        Row("fluid.implicit_viscosity.image", "v", "m/s", "A way", saved=False),
    )

    def __init__(self, build: Build, params: Params):
        fluid = build.config.fluid
        self.params, self.state, self.pairs = params, build.state, build.parts["pairs"]
        self.x, self.v, self.mass, self.forces, self.pressure_acceleration = (build.state[n] for n in self.rows)
        self.change, self.grip, self.goal, self.u, self.left, self.way, self.image = (
            build.state[row.name] for row in self.scratch
        )
        self.wall = WallViscosity(build, fluid.liquid.nu)
        self.factor = 10.0 * fluid.liquid.nu / fluid.liquid.rest_density
        self.weight = math.sqrt(sum(g * g for g in build.config.space.gravity))
        self.soft = 0.01 * (0.5 * fluid.support_radius) ** 2
        capacity = build.state.sizes["fluid"]
        self.few = runtime.few(capacity)
        self.inverse = ti.Matrix.field(3, 3, float, shape=capacity)
        self.partial = ti.Vector.field(3, ti.f64, shape=max(-(-capacity // BLOCK), 1))
        self.tie = None
        self.iterations = 0

    def stages(self) -> tuple[Stage, ...]:
        """viscosity (accelerate)."""
        return (Stage("viscosity", "accelerate", self.run, self.rows, ("fluid.v", "fluid.acceleration")),)

    def run(self, dt: float) -> None:
        """Solve, and leave the change of velocity in v and acceleration."""
        neighbour = self.pairs.neighbour
        if self.tie is None or self.tie.shape[0] != neighbour.shape[0]:
            try:
                self.tie = ti.Vector.field(3, float, shape=neighbour.shape[0])
            except RuntimeError as error:
                raise CapacityError(f"fluid: no memory for {neighbour.shape[0]} pairs; use a larger spacing") from error
        self._bind(dt, neighbour, self.pairs.gradient, self.tie)
        steepness, left, scale = self._begin(self.weight * dt, neighbour, self.tie)
        self.iterations = 0
        while left > self.params.error**2 * scale and self.iterations < self.params.iterations_max:
            length = steepness / max(self._look(neighbour, self.tie), 1e-300)
            before = steepness
            steepness, left = self._go(length)
            self._turn(steepness / max(before, 1e-300))
            self.iterations += 1
        self._end(dt, neighbour, self.tie)

    @ti.func
    def _bent(self, i, u: ti.template(), neighbour: ti.template(), tie: ti.template()):
        """(A u)_i - u_i = sum_k tie (tie . (u_i - u_j)) + grip u_i."""
        own = u[i]
        total = ti.Vector([0.0, 0.0, 0.0])
        if ti.static(self.wall.some):
            total += self.grip[i] * own
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            total += tie[k] * tie[k].dot(own - u[neighbour[k]])
        return total

    @ti.kernel
    def _bind(self, dt: float, neighbour: ti.template(), gradient: ti.template(), tie: ti.template()):
        """v*, a first guess of u, the ties, and each particle's block inverted."""
        for i in range(self.state.count[None]):
            block = ti.Matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
            slide = ti.Vector([0.0, 0.0, 0.0])
            if ti.static(self.wall.some):
                rate, push = self.wall.drag(i)
                self.grip[i], slide = dt * rate, dt * push
                block *= 1.0 + self.grip[i]
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                r = self.pairs.apart(self.x[i], neighbour[k])
                size = r.norm_sqr()
                strength = -dt * self.factor * gradient[k].dot(r) / ti.max(size * (size + self.soft), 1e-30)
                tie[k] = ti.sqrt(ti.max(strength, 0.0)) * r
                block += tie[k].outer_product(tie[k])
            self.inverse[i] = block.inverse()
            self.goal[i] = self.v[i] + dt * self.pressure_acceleration[i] + slide
            self.u[i] = self.goal[i] + dt * self.change[i]

    @ti.kernel
    def _begin(self, least: float, neighbour: ti.template(), tie: ti.template()) -> ti.types.vector(3, ti.f64):
        """left and the first way; sums of m left . z (z = inverse left), m left^2, and m max(|v*|, least)^2."""
        count = self.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                total = ti.Vector([0.0, 0.0, 0.0], ti.f64)
                for i in range(turn // TURNS * BLOCK, ti.min((turn // TURNS + 1) * BLOCK, count)):
                    left = self.goal[i] - self.u[i] - self._bent(i, self.u, neighbour, tie)
                    z = self.inverse[i] @ left
                    self.left[i], self.way[i] = left, z
                    total += self.mass[i] * ti.Vector(
                        [left.dot(z), left.norm_sqr(), ti.max(self.goal[i].norm_sqr(), least * least)]
                    )
                self.partial[turn // TURNS] = total
        sums = ti.Vector([0.0, 0.0, 0.0], ti.f64)
        ti.loop_config(serialize=True)
        for block in range((count + BLOCK - 1) // BLOCK):
            sums += self.partial[block]
        return sums

    @ti.kernel
    def _look(self, neighbour: ti.template(), tie: ti.template()) -> ti.f64:
        """image = A way; the sum of m way . image."""
        count = self.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                total = ti.f64(0.0)
                for i in range(turn // TURNS * BLOCK, ti.min((turn // TURNS + 1) * BLOCK, count)):
                    self.image[i] = self.way[i] + self._bent(i, self.way, neighbour, tie)
                    total += self.mass[i] * self.way[i].dot(self.image[i])
                self.partial[turn // TURNS][0] = total
        summed = ti.f64(0.0)
        ti.loop_config(serialize=True)
        for block in range((count + BLOCK - 1) // BLOCK):
            summed += self.partial[block][0]
        return summed

    @ti.kernel
    def _go(self, length: float) -> ti.types.vector(2, ti.f64):
        """A step along the way; image becomes z. Sums of m left . z and m left^2."""
        count = self.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                total = ti.Vector([0.0, 0.0, 0.0], ti.f64)
                for i in range(turn // TURNS * BLOCK, ti.min((turn // TURNS + 1) * BLOCK, count)):
                    self.u[i] += length * self.way[i]
                    left = self.left[i] - length * self.image[i]
                    z = self.inverse[i] @ left
                    self.left[i], self.image[i] = left, z
                    total += self.mass[i] * ti.Vector([left.dot(z), left.norm_sqr(), 0.0])
                self.partial[turn // TURNS] = total
        sums = ti.Vector([0.0, 0.0], ti.f64)
        ti.loop_config(serialize=True)
        for block in range((count + BLOCK - 1) // BLOCK):
            sums += self.partial[block].xy
        return sums

    @ti.kernel
    def _turn(self, share: float):
        """The next way: downhill, and on from the last."""
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            self.way[i] = self.image[i] + share * self.way[i]

    @ti.kernel
    def _end(self, dt: float, neighbour: ti.template(), tie: ti.template()):
        for i in range(self.state.count[None]):
            gain = -self._bent(i, self.u, neighbour, tie)
            if ti.static(self.wall.some):
                gain += self.goal[i] - self.v[i] - dt * self.pressure_acceleration[i]
            self.change[i] = gain / dt
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            self.v[i] += dt * self.change[i]
            self.forces[i] += self.change[i]
