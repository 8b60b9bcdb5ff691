"""The layer: water that touches the sheet, moving as mass points inside the cloth's substeps.

Each constraint is C = s n . (x_w - sum b_k x_k) - d >= 0 with zero compliance, weighted by inverse mass, one
sequential sweep a substep (Macklin 2019). That alone carries 130:1 of water on cloth; pushing the cloth with the
water's pressure in a step of its own diverges at every dt (added mass, Guendelman 2005).
"""

import numpy as np
import taichi as ti

from sim import runtime
from sim.cloth.board import pitch_of, place_of, private_real
from sim.maths.facet import plane_gap
from sim.scene.puddle import TOUCH, film_height

OFFSET = 0.4
"""[dx] Rest gap of a particle over the sheet; less lets the last step act, more floats the water."""
PUSH_OUT = 0.1
"""[m/s] How fast a particle that starts nearer than that is moved out: at once would be a 9 m/s kick."""
BOUNCES = 0.4
"""[m/s] Slower arrivals do not bounce: a resting pool must not simmer."""
PATIENCE = 0.02
"""[s] The pull that a particle feels on the cloth follows its pressure over this time. Pressure answers to the cloth a
step late; fed back at once the water over a layer bounces on it, seventeen steps a bounce and 6 % damped."""
EDGES = 2
"""That a particle may pass from triangle to triangle in a substep."""
LOST = 1.0
"""[m] Gap of who left over a hem: free for the rest of the step, or it would be sent back to where it came from."""
REACH = 1.1
"""[dx] Particles nearer than this at the start of a step belong to the layer."""


@ti.data_oriented
class Layer:
    """A guest of the cloth solver (see sim.cloth.xpbd): begin; predict, project, finish each substep; end.

    Within a step it keeps positions in the solver's own precision: a substep's fall is lost in an f32.

    corner (t,) ivec3    where the corners of each triangle stand on the solver's board
    """

    reads = (
        "fluid.x", "fluid.v", "fluid.mass", "fluid.acceleration", "fluid.pressure_acceleration", "fluid.expected_pull",
        "fluid.triangle", "fluid.side", "cloth.v", "cloth.inv_mass",
    )  # fmt: skip
    writes = (
        "fluid.x", "fluid.v", "fluid.expected_pull", "fluid.triangle", "cloth.v", "cloth.push_front", "cloth.push_back",
    )  # fmt: skip

    def __init__(self, build, sheet):
        state, config = build.state, build.config
        self.build, self.sheet, self.state_count = build, sheet, state.count
        self.x, self.v, self.mass = state["fluid.x"], state["fluid.v"], state["fluid.mass"]
        self.acceleration = state["fluid.acceleration"]
        self.pressure_acceleration = state["fluid.pressure_acceleration"]
        self.expected = state["fluid.expected_pull"]
        self.triangle, self.side = state["fluid.triangle"], state["fluid.side"]
        self.node_v, self.node_w = state["cloth.v"], state["cloth.inv_mass"]
        self.push_front, self.push_back = state["cloth.push_front"], state["cloth.push_back"]
        self.dx = config.fluid.spacing
        self.restitution = config.coupling.restitution
        film = film_height(config, self.dx)
        self.viscous_rate = 3.0 * config.fluid.liquid.nu / film**2
        self.rough_rate = 0.5 * config.coupling.friction / film
        self.real = private_real()
        capacity = state.sizes["fluid"]
        self.count, self.touched = ti.field(ti.i32, shape=()), ti.field(ti.i32, shape=())
        self.elapsed = ti.field(self.real, shape=())
        self.few = runtime.few(self.push_front.shape[0] // 5)
        triangles, nj = np.asarray(build.scene.sheet.triangles, np.int32), build.scene.sheet.shape[1]
        self.corner = ti.Vector.field(3, ti.i32, shape=len(triangles))
        self.corner.from_numpy(place_of(triangles, nj, pitch_of(nj)))
        self.rubs = ti.field(ti.i32, shape=capacity)
        self.row, self.at = ti.field(ti.i32, shape=capacity), ti.field(ti.i32, shape=capacity)
        self.weight, self.face, self.gap, self.push = (ti.field(self.real, shape=capacity) for _ in range(4))
        self.place, self.speed, self.pull, self.normal, self.share = (
            ti.Vector.field(3, self.real, shape=capacity) for _ in range(5)
        )

    @property
    def cloth(self):
        """The solver whose guest this is; built after it."""
        return self.build.parts["cloth"]

    @ti.kernel
    def begin(self, dt: float):
        """Take the layer out of the water: undo this step's acceleration, which the substeps give in parts."""
        ti.loop_config(serialize=self.few)
        for n in range(self.push_front.shape[0]):
            self.push_front[n] = 0.0
            self.push_back[n] = 0.0
        self.elapsed[None] = 0.0
        news = 1.0 - ti.exp(-dt / PATIENCE)
        found = 0
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            self.expected[i] += news * (self.pressure_acceleration[i] - self.expected[i])
            if self.side[i] != 0:
                side = ti.cast(self.side[i], self.real)
                _, height, _w = plane_gap(self.x[i], *self.sheet.points(self.triangle[i]))
                gap = side * height
                if gap < REACH * self.dx:
                    self.row[found], self.at[found] = i, self.triangle[i]
                    self.weight[found], self.face[found], self.gap[found] = 1.0 / self.mass[i], side, gap
                    self.place[found] = ti.cast(self.x[i], self.real)
                    self.speed[found] = ti.cast(self.v[i] - dt * self.acceleration[i], self.real)
                    self.pull[found] = ti.cast(self.acceleration[i] + self.expected[i], self.real)
                    found += 1
        self.count[None] = found

    @ti.kernel
    def end(self, dt: float):
        """Put it back so that `x += dt v` of the mover ends where the substeps ended; the pressure that they expected
        is taken off again, since the solve gives all of it. Those that touch feel the drag of the whole step, which is
        slow beside what the substeps are for, and go their way at the mean of the speeds before it and after."""
        ti.loop_config(serialize=True)
        for s in range(self.count[None]):
            i, before = self.row[s], self.speed[s]
            if self.rubs[s]:
                self._rub(s, dt)
            self.x[i] = ti.cast(self.place[s] - 0.5 * dt * (before + self.speed[s]), float)
            self.v[i] = ti.cast(self.speed[s], float) - dt * self.expected[i]
            self.triangle[i] = self.at[s]

    @ti.func
    def predict(self, h):
        """Nothing: each goes on as its turn in `project` comes."""

    @ti.func
    def project(self, h):
        """Gravity, terms and last step's pressure, the free move; and one sweep over all contacts."""
        self.elapsed[None] += h
        for s in range(self.count[None]):
            v = self.speed[s] + h * self.pull[s]
            x = self.place[s] + h * v
            t, gap, n, b = self._find_plane(x, self.at[s], self.face[s])
            self.at[s], self.normal[s], self.share[s] = t, n, b
            self.rubs[s] = gap < TOUCH * self.dx
            self.push[s] = 0.0
            if gap == LOST:
                self.face[s] = 0.0
            missing = ti.min(OFFSET * self.dx, self.gap[s] + PUSH_OUT * self.elapsed[None]) - gap
            if missing > 0.0:
                corner, node = self.corner[t], self.sheet.corner[t]
                push = missing / self._effective(s)
                self.push[s] = push
                x += self.weight[s] * push * n
                v += self.weight[s] * push / h * n
                for k in range(3):
                    self.cloth.shift(corner[k], -self.cloth.weight(corner[k]) * b[k] * push * n)
                    impulse = ti.cast(b[k] * push / h, float)
                    self.push_front[node[k]] += impulse * (self.face[s] > 0.0)
                    self.push_back[node[k]] += impulse * (self.face[s] < 0.0)
                self.touched[None] = 1
            self.place[s], self.speed[s] = x, v

    @ti.func
    def finish(self, h):
        """Restitution of those in contact, opposite impulse to the sheet."""
        if ti.static(self.restitution > 0.0):
            for s in range(self.count[None]):
                if self.push[s] > 0.0:
                    corner, b, n = self.corner[self.at[s]], self.share[s], self.normal[s]
                    r = self.speed[s]
                    for k in range(3):
                        r -= b[k] * self.cloth.velocity(corner[k])
                    w = self._effective(s)
                    impulse = self._bounce(r, r.dot(n) - self.weight[s] * self.push[s] / h, n, w)
                    for k in range(3):
                        self.cloth.push(corner[k], -self.cloth.weight(corner[k]) * b[k] * impulse)
                    self.speed[s] += self.weight[s] * impulse

    @ti.func
    def _find_plane(self, x, at, side):
        """(triangle under x, gap, normal, weights of its corners), over at most two edges from `at`; the gap is LOST
        beyond a hem, and for side 0."""
        n, w, gap = (
            ti.Vector([0.0, 0.0, 0.0], self.real),
            ti.Vector([0.0, 0.0, 0.0], self.real),
            ti.cast(LOST, self.real),
        )
        turn = 0
        while turn <= EDGES and side != 0.0:
            c = self.corner[at]
            n, gap, w = plane_gap(x, self.cloth.position(c[0]), self.cloth.position(c[1]), self.cloth.position(c[2]))
            gap *= side
            beyond = w.min() < 0.0
            if beyond and turn < EDGES:
                k = 0
                if w[1] < w[0]:
                    k = 1
                if w[2] < ti.min(w[0], w[1]):
                    k = 2
                beside = self.sheet.beside[at][k]
                if beside < 0:
                    gap = LOST
                    turn = EDGES
                else:
                    at = beside
                turn += 1
            else:
                turn = EDGES + 1
        if w.min() < 0.0:
            w = ti.max(w, 0.0)
            w /= w.sum()
        return at, gap, side * n, w

    @ti.func
    def _effective(self, s):
        """Inverse mass that the contact feels: w + sum b_k^2 w_k [1/kg]."""
        w = self.weight[s]
        for k in range(3):
            b = self.share[s][k]
            w += b * b * self.cloth.weight(self.corner[self.at[s]][k])
        return w

    @ti.func
    def _rub(self, s, dt):
        """Drag of the film over dt, opposite impulse to the sheet.

        What glides, dr/dt = -w/w_point (3 nu/d^2 + friction |r|/(2 d)) r along the surface, is solved for exactly.
        """
        corner, b, n = self.sheet.corner[self.at[s]], self.share[s], self.normal[s]
        r, w = self.speed[s], self.weight[s]
        for k in range(3):
            r -= b[k] * self.node_v[corner[k]]
            w += b[k] * b[k] * self.node_w[corner[k]]
        r -= r.dot(n) * n
        ratio = w / self.weight[s]
        left = ti.exp(-ratio * self.viscous_rate * dt)
        acting = dt  # [s], less where viscosity has slowed it meanwhile
        if left < 1.0:
            acting = (1.0 - left) / (ratio * self.viscous_rate)
        left /= 1.0 + ratio * self.rough_rate * r.norm() * acting
        impulse = (left - 1.0) / w * r
        for k in range(3):
            self.node_v[corner[k]] -= self.node_w[corner[k]] * b[k] * impulse
        self.speed[s] += self.weight[s] * impulse

    @ti.func
    def _bounce(self, r, arriving, n, w):
        """What restitution adds along the normal to a contact that arrived fast [N s]."""
        impulse = ti.Vector([0.0, 0.0, 0.0], self.real)
        if arriving < -BOUNCES:
            impulse = ti.max(-self.restitution * arriving - r.dot(n), 0.0) / w * n
        return impulse
