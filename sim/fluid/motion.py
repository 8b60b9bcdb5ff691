"""What pressure methods share: gravity and the scene's terms, the move, and the step that speed allows."""

import taichi as ti

from sim import runtime
from sim.registry import method
from sim.stage import Build, Limit, Stage


@ti.data_oriented
class Motion:
    """Stages "forces" (slot accelerate) and "move" of the water.

    forces   acceleration = g + sum of terms; v += dt acceleration
    move     x += dt v, out of solids, round periodic space: which v, the scene's mover says; where a method has a
             `way` [m/s] of its own, x += dt way, and v stays
    limits   dt <= cfl spacing / max |v|, and each term's own
    """

    rows = ("fluid.x", "fluid.v", "fluid.acceleration")
    scratch = ()

    def __init__(self, build: Build, terms: tuple, cfl: float, way=None):
        self.state, self.pairs, self.walls, self.terms = build.state, build.parts["pairs"], build.parts["walls"], terms
        self.wall_terms = tuple(term for term in terms if getattr(term, "at_walls", False))
        self.x, self.v, self.acceleration = (build.state[name] for name in self.rows)
        self.mover = method("fluid.mover", build.config.fluid.mover)(build, way)
        self.gravity = ti.Vector([float(g) for g in build.config.space.gravity])
        self.few = runtime.few(build.state.sizes["fluid"])
        self.reach = cfl * build.config.fluid.spacing

    def stages(self) -> tuple[Stage, ...]:
        """forces and move."""
        changed = ("fluid.v", "fluid.acceleration")
        reads = tuple(dict.fromkeys([*self.rows, *(row for term in self.terms for row in term.rows)]))
        return (
            Stage("forces", "accelerate", self.accelerate, reads, changed, self._of_terms),
            Stage("move", "move", self.move, ("fluid.x", "fluid.v"), ("fluid.x", "fluid.v"), self._of_speed),
        )

    def accelerate(self, dt: float) -> None:
        """acceleration from gravity and terms; v += dt acceleration."""
        self._accelerate(dt, self.pairs.neighbour, self.pairs.slope)

    def move(self, dt: float) -> None:
        """x by the scene's mover, kept out of solids."""
        self._move(dt)

    def _of_terms(self) -> Limit:
        return min((term.limit() for term in self.terms), default=Limit(float("inf"), "no term"))

    def _of_speed(self) -> Limit:
        return Limit(self.reach / max(self.fastest(), 1e-12), "water speed")

    @ti.kernel
    def _accelerate(self, dt: float, neighbour: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            a = self.gravity
            if ti.static(len(self.terms) > 0):
                x = self.x[i]
                for k in range(self.pairs.start[i], self.pairs.stop[i]):
                    j = neighbour[k]
                    r = self.pairs.apart(x, j)
                    for term in ti.static(self.terms):
                        a += term.acceleration(i, j, r, slope[k] * r)
            for term in ti.static(self.wall_terms):
                a += term.wall_acceleration(i)
            self.acceleration[i] = a
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            self.mover.begin(i)
            self.v[i] += dt * self.acceleration[i]

    @ti.kernel
    def _move(self, dt: float):
        for i in range(self.state.count[None]):
            self.mover.move(i, dt)
            if ti.static(len(self.pairs.torus.axes) > 0):
                self.x[i] = self.pairs.torus.wrap(self.x[i])

    @ti.kernel
    def fastest(self) -> float:
        """max |v| [m/s]."""
        fastest = 0.0
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            ti.atomic_max(fastest, self.v[i].norm_sqr())
        return ti.sqrt(fastest)
