"""The scene's solids as water and cloth meet them: distance, and velocity where they move."""

import numpy as np
import taichi as ti
import taichi.math as tm

from sim.maths.distance import box_distance, cylinder_distance, grid_distance, sphere_distance
from sim.scene.solids import SHAPES
from sim.stage import Build, Limit, Stage

PLANE, BOX, SPHERE, CYLINDER, MESH = range(len(SHAPES))
REACH = 0.4
"""[dx] No solid moves farther in a step: as far as water may, and not through what it has not seen."""


@ti.data_oriented
class Bodies:
    """Every primitive of the scene, as fields; one for water and cloth: Bodies.of(build).

    distance(s, x)   (outward normal, signed distance [m]) of solid s at x
    beside(s, r)     how far r, from its centre, at least is from solid s [m]: from its box; of a plane -inf
    velocity(s, x)   of the solid's material at x [m/s], over the step under way
    count, moves     how many there are; whether any has a path
    friction[s]      Coulomb's
    """

    def __init__(self, build: Build):
        self.solids, self.parts = build.scene.solids, build.parts
        primitives = self.solids.primitives
        self.count, self.moves = len(primitives), self.solids.moves
        self.rough = any(p.friction > 0.0 for p in primitives)
        self.step_max = REACH * build.config.fluid.spacing if getattr(build.config, "fluid", None) else float("inf")
        self.ahead = build.config.run.dt_max if self.moves else 0.0
        rows = max(self.count, 1)
        self.shape = ti.field(ti.i32, shape=rows)
        self.friction = ti.field(float, shape=rows)
        self.half, self.centre, self.box, self.linear, self.angular = (
            ti.Vector.field(3, float, shape=rows) for _ in range(5)
        )
        self.turn = ti.Matrix.field(3, 3, float, shape=rows)
        self.shape.from_numpy(np.array([SHAPES.index(p.shape) for p in primitives] or [0], np.int32))
        self.friction.from_numpy(np.array([p.friction for p in primitives] or [0.0]))
        self.half.from_numpy(np.array([p.half for p in primitives] or np.zeros((1, 3))))
        self.real = np.float64 if self.friction.dtype == ti.f64 else np.float32
        self._take_grids([p.grid for p in primitives])
        self.place(0.0)

    @staticmethod
    def of(build: Build) -> "Bodies":
        """build.parts["bodies"], made when first asked for."""
        if "bodies" not in build.parts:
            build.parts["bodies"] = Bodies(build)
        return build.parts["bodies"]

    def _take_grids(self, grids: list) -> None:
        """One list of all samples; where each mesh's begin, how many they are, where they lie."""
        self.meshes = any(grids)
        rows, sizes = max(len(grids), 1), [g.distance.size if g else 0 for g in grids]
        self.samples = ti.field(float, shape=max(sum(sizes), 1))
        self.first = ti.field(ti.i32, shape=rows)
        self.many = ti.Vector.field(3, ti.i32, shape=rows)
        self.low = ti.Vector.field(3, float, shape=rows)
        self.cell = ti.field(float, shape=rows)
        if self.meshes:
            self.samples.from_numpy(np.concatenate([g.distance.ravel() for g in grids if g]))
            self.first.from_numpy((np.cumsum(sizes) - sizes).astype(np.int32))
            self.many.from_numpy(np.array([g.distance.shape if g else (2, 2, 2) for g in grids], np.int32))
            self.low.from_numpy(np.array([g.low if g else np.zeros(3) for g in grids]))
            self.cell.from_numpy(np.array([g.cell if g else 1.0 for g in grids]))

    def stages(self) -> tuple[Stage, ...]:
        """None where nothing moves; else where solids are and how fast they go, and their places at the step's end."""
        if not self.moves:
            return ()
        return (
            Stage("solids", "source", self.start, limit=self._limit),
            Stage("solids move", "move", lambda dt: self.place(self.parts["clock"].time + dt)),
        )

    def start(self, dt: float) -> None:
        """Places at the step's start, velocities over the step."""
        now = self.parts["clock"].time
        self.place(now, np.array([p.motion(now, now + dt) for p in self.solids.primitives]))

    def place(self, time: float, motion: np.ndarray | None = None) -> None:
        """Where every solid is at a time [s]; motion (count, 2, 3): linear and angular velocity, absent as it was."""
        if self.count:
            placed = [p.place(time) for p in self.solids.primitives]
            poses = np.array([np.concatenate([c[None], t]) for c, t in placed], self.real)
            given = np.zeros((self.count, 2, 3)) if motion is None else motion
            self._place(poses, given.astype(self.real), motion is not None)

    def _limit(self) -> Limit:
        """No solid moves farther than REACH in a step, going by its speed about now."""
        now = self.parts["clock"].time
        speeds = [p.course.top_speed(now, now + self.ahead, p.arm()) for p in self.solids.primitives if p.course]
        return Limit(self.step_max / max(max(speeds), 1e-12), "solid speed")

    @ti.kernel
    def _place(self, poses: ti.types.ndarray(), motion: ti.types.ndarray(), moved: ti.i32):
        ti.loop_config(serialize=True)
        for s in range(self.count):
            self.box[s] = tm.vec3(float("inf") if self.shape[s] == PLANE else 0.0)
            for d in ti.static(range(3)):
                self.centre[s][d] = poses[s, 0, d]
                for e in ti.static(range(3)):
                    self.turn[s][d, e] = poses[s, 1 + d, e]
                    self.box[s][d] += ti.abs(self.turn[s][d, e]) * self.half[s][e]
                if moved == 1:
                    self.linear[s][d], self.angular[s][d] = motion[s, 0, d], motion[s, 1, d]

    @ti.func
    def beside(self, s, r):
        """At least this far from solid s is the point r from its centre [m]: a few subtractions spare `distance`."""
        return (ti.abs(r) - self.box[s]).max()

    @ti.func
    def inside(self, s, x):
        """x in the solid's own axes, from its centre."""
        return self.turn[s].transpose() @ (x - self.centre[s])

    @ti.func
    def distance(self, s, x):
        """(outward normal, signed distance [m]) of solid s at x; of a mesh as far as its samples go."""
        r = self.inside(s, x)
        nd = tm.vec4(0.0, 0.0, 1.0, r[2])
        if self.shape[s] == BOX:
            nd = box_distance(r, self.half[s])
        elif self.shape[s] == SPHERE:
            nd = sphere_distance(r, self.half[s][0])
        elif self.shape[s] == CYLINDER:
            nd = cylinder_distance(r, self.half[s][0], self.half[s][2])
        if ti.static(self.meshes):
            if self.shape[s] == MESH:
                nd = grid_distance(self.samples, self.first[s], self.many[s], self.cell[s], r - self.low[s])
        return tm.vec4(self.turn[s] @ nd.xyz, nd[3])

    @ti.func
    def velocity(self, s, x):
        """Of the solid's material at x over the step under way [m/s]."""
        u = tm.vec3(0.0)
        if ti.static(self.moves):
            u = self.linear[s] + self.angular[s].cross(x - self.centre[s])
        return u
