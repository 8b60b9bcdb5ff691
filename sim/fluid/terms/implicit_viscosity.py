"""Viscosity of thick liquids, at the speed that it leaves behind: no step is too long for it."""

import math

import taichi as ti

from sim.crew import BLOCK, Crew, Lists, blocks, rows
from sim.errors import CapacityError
from sim.fluid.terms.wall_viscosity import WallViscosity
from sim.registry import register
from sim.schema import Model, quantity
from sim.stage import Build, Stage
from sim.state import Row

BIND, START, LOOK, GO, TURN, END = range(6)
"""Phases of the work."""


@register("fluid.term", "implicit_viscosity")
@ti.data_oriented
class ImplicitViscosity:
    """v_i = v*_i + dt sum_j 10 nu m_j/rho0 (v_ij . r)/(r^2 + 0.01 h^2) grad W_ij, h = H/2.   Weiler 2018, eq. 13

    v* has gravity and the pressure of the step before, which is taken out again: honey at rest is not sheared. The
    system, symmetric by mass, is solved by conjugate gradients with each particle's own 3 x 3 block inverted ahead. Its
    forces are central and taken once more from the solution: momentum and spin hold to rounding however far it got.
    Solids with no_slip hold it (see WallViscosity). A thread turns freely, as the form of Morris 1997 (see
    viscosity) does not let it; in return nu comes out at 0.85 in settled
    liquid at support 2, 0.97 at 3. Bounds no step.
    """

    class Params(Model):
        error: float = quantity(1e-3, ge=1e-6, le=0.1, why="rms velocity left to change, over the rms velocity")
        iterations_max: int = quantity(200, ge=1, le=100000, why="a cap; the residual ends it sooner")

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
        self.crew = Crew()
        self.error_sq, self.iterations_max = params.error**2, params.iterations_max
        self.phase, self.taken = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.length, self.share = ti.field(float, ()), ti.field(float, ())
        self.steepness, self.scale = ti.field(ti.f64, ()), ti.field(ti.f64, ())
        self.inverse = ti.Matrix.field(3, 3, float, shape=capacity)
        self.partial = ti.Vector.field(3, ti.f64, shape=max(-(-capacity // BLOCK), 1))
        self.lists = None

    def stages(self) -> tuple[Stage, ...]:
        """viscosity (accelerate)."""
        return (Stage("viscosity", "accelerate", self.run, self.rows, ("fluid.v", "fluid.acceleration")),)

    def run(self, dt: float) -> None:
        """Solve, and leave the change of velocity in v and acceleration."""
        neighbour, slope = self.pairs.neighbour, self.pairs.slope
        if self.lists is None or self.lists.slope is not slope:
            try:
                tie = ti.Vector.field(3, float, shape=slope.shape)
            except RuntimeError as error:
                raise CapacityError(f"fluid: no memory for {slope.shape[0]} pairs; use a larger spacing") from error
            self.lists = Lists(neighbour=neighbour, slope=slope, tie=tie)
        self.crew.run(self, dt, self.lists)

    @ti.func
    def begin(self):
        """Before the first phase."""
        self.phase[None], self.taken[None] = BIND, 0

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
        phase, total = self.phase[None], ti.Vector([0.0, 0.0, 0.0], ti.f64)
        first, end = rows(task, self.state.count[None])
        for i in range(first, end):
            if phase == BIND:
                self._bind(i, dt, lists)
            elif phase == START:
                total += self._start(i, dt, lists)
            elif phase == LOOK:
                total[0] += self._look(i, lists)
            elif phase == GO:
                total += self._go(i)
            elif phase == TURN:
                self.way[i] = self.image[i] + self.share[None] * self.way[i]
            else:
                self._end(i, dt, lists)
        self.partial[task] = total

    @ti.func
    def decide(self):
        """BIND, START, (LOOK, GO, TURN) ..., END."""
        phase, sums = self.phase[None], self._sums()
        following = phase + 1
        if phase == START:
            self.steepness[None], self.scale[None] = sums[0], sums[2]
            following = self._again(sums[1])
        elif phase == LOOK:
            self.length[None] = ti.cast(self.steepness[None] / ti.max(sums[0], 1e-300), float)
        elif phase == GO:
            self.share[None] = ti.cast(sums[0] / ti.max(self.steepness[None], 1e-300), float)
            self.steepness[None] = sums[0]
            self.taken[None] += 1
            following = TURN if self._again(sums[1]) == LOOK else END
        elif phase == TURN:
            following = LOOK
        self.phase[None] = following
        return phase != END

    @ti.func
    def _again(self, left):
        """LOOK, or END where what is left is little enough."""
        more = left > self.error_sq * self.scale[None] and self.taken[None] < self.iterations_max
        return LOOK if more else END

    @ti.func
    def _sums(self):
        """Of the phase, over blocks in order."""
        sums = ti.Vector([0.0, 0.0, 0.0], ti.f64)
        for block in range((self.state.count[None] + BLOCK - 1) // BLOCK):
            sums += self.partial[block]
        return sums

    @ti.func
    def _bent(self, i, u: ti.template(), lists: ti.template()):
        """(A u)_i - u_i = sum_k tie (tie . (u_i - u_j)) + grip u_i."""
        own = u[i]
        total = ti.Vector([0.0, 0.0, 0.0])
        if ti.static(self.wall.some):
            total += self.grip[i] * own
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            total += lists.tie[k] * lists.tie[k].dot(own - u[lists.neighbour[k]])
        return total

    @ti.func
    def _bind(self, i, dt, lists: ti.template()):
        """v*, a first guess of u, the ties, and the particle's block inverted."""
        block = ti.Matrix([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        slide = ti.Vector([0.0, 0.0, 0.0])
        if ti.static(self.wall.some):
            rate, push = self.wall.drag(i)
            self.grip[i], slide = dt * rate, dt * push
            block *= 1.0 + self.grip[i]
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            r = self.pairs.apart(self.x[i], lists.neighbour[k])
            size = r.norm_sqr()
            strength = -dt * self.factor * lists.slope[k] * size / ti.max(size * (size + self.soft), 1e-30)
            lists.tie[k] = ti.sqrt(ti.max(strength, 0.0)) * r
            block += lists.tie[k].outer_product(lists.tie[k])
        self.inverse[i] = block.inverse()
        self.goal[i] = self.v[i] + dt * self.pressure_acceleration[i] + slide
        self.u[i] = self.goal[i] + dt * self.change[i]

    @ti.func
    def _start(self, i, dt, lists: ti.template()):
        """left and the first way; m left . z (z = inverse left), m left^2, and m max(|v*|, dt g)^2."""
        left = self.goal[i] - self.u[i] - self._bent(i, self.u, lists)
        z = self.inverse[i] @ left
        self.left[i], self.way[i] = left, z
        least = self.weight * dt
        return self.mass[i] * ti.Vector([left.dot(z), left.norm_sqr(), ti.max(self.goal[i].norm_sqr(), least * least)])

    @ti.func
    def _look(self, i, lists: ti.template()):
        """image = A way; m way . image."""
        self.image[i] = self.way[i] + self._bent(i, self.way, lists)
        return self.mass[i] * self.way[i].dot(self.image[i])

    @ti.func
    def _go(self, i):
        """A step along the way; image becomes z. m left . z and m left^2."""
        self.u[i] += self.length[None] * self.way[i]
        left = self.left[i] - self.length[None] * self.image[i]
        z = self.inverse[i] @ left
        self.left[i], self.image[i] = left, z
        return self.mass[i] * ti.Vector([left.dot(z), left.norm_sqr(), 0.0])

    @ti.func
    def _end(self, i, dt, lists: ti.template()):
        """The solution's forces, and v by them. Neighbours are asked for u, which stays."""
        gain = -self._bent(i, self.u, lists)
        if ti.static(self.wall.some):
            gain += self.goal[i] - self.v[i] - dt * self.pressure_acceleration[i]
        change = gain / dt
        self.change[i] = change
        self.v[i] += dt * change
        self.forces[i] += change
