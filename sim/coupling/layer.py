"""The layer: water that touches the sheet, moving as mass points inside the cloth's substeps.

Each constraint is C = s n . (x_w - sum b_k x_k) - d >= 0 with zero compliance, weighted by inverse mass, one
sequential sweep a substep (Macklin 2019). That alone carries 130:1 of water on cloth; pushing the cloth with the
water's pressure in a step of its own diverges at every dt (added mass, Guendelman 2005).
"""

import taichi as ti

from sim.cloth.board import private_real
from sim.maths.facet import plane_gap

OFFSET = 0.4
"""[dx] Rest gap of a particle over the sheet; less lets the last step act, more floats the water."""
PUSH_OUT = 0.1
"""[m/s] How fast a particle that starts nearer than that is moved out: at once would be a 9 m/s kick."""
REACH = 1.1
"""[dx] Particles nearer than this at the start of a step belong to the layer."""


@ti.data_oriented
class Layer:
    """A guest of the cloth solver (see sim.cloth.xpbd): begin; predict, project, finish each substep; end.

    Within a step it keeps positions in the solver's own precision: a substep's fall is lost in an f32.
    """

    def __init__(self, build, sheet):
        state, config = build.state, build.config
        self.build, self.sheet, self.state_count = build, sheet, state.count
        self.x, self.v, self.mass = state["fluid.x"], state["fluid.v"], state["fluid.mass"]
        self.acceleration = state["fluid.acceleration"]
        self.pressure_acceleration = state["fluid.pressure_acceleration"]
        self.triangle, self.side = state["fluid.triangle"], state["fluid.side"]
        self.push_front, self.push_back = state["cloth.push_front"], state["cloth.push_back"]
        self.dx = config.fluid.spacing
        self.friction, self.restitution = config.coupling.friction, config.coupling.restitution
        self.real = private_real()
        vec3 = ti.types.vector(3, self.real)
        capacity = state.sizes["fluid"]
        self.count, self.touched = ti.field(ti.i32, shape=()), ti.field(ti.i32, shape=())
        self.elapsed = ti.field(self.real, shape=())
        self.row = ti.field(ti.i32, shape=capacity)
        self.point = ti.types.struct(
            x=vec3, start=vec3, v=vec3, a=vec3, w=self.real, gap=self.real, push=self.real, side=self.real,
            triangle=ti.i32,
        ).field(shape=capacity)  # fmt: skip

    @property
    def cloth(self):
        """The solver whose guest this is; built after it."""
        return self.build.parts["cloth"]

    @ti.kernel
    def begin(self, dt: float):
        """Take the layer out of the water: undo this step's acceleration, which the substeps give in parts."""
        for n in self.push_front:
            self.push_front[n] = 0.0
            self.push_back[n] = 0.0
        self.elapsed[None] = 0.0
        found = 0
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            if self.side[i] != 0:
                side = ti.cast(self.side[i], self.real)
                _, height, _w = plane_gap(self.x[i], *self.sheet.points(self.triangle[i]))
                gap = side * height
                if gap < REACH * self.dx:
                    self.row[found] = i
                    p = self.point[found]
                    p.x, p.w = ti.cast(self.x[i], self.real), 1.0 / self.mass[i]
                    p.v = ti.cast(self.v[i] - dt * self.acceleration[i], self.real)
                    p.a = ti.cast(self.acceleration[i] + self.pressure_acceleration[i], self.real)
                    p.gap, p.push, p.side, p.triangle = gap, 0.0, side, self.triangle[i]
                    self.point[found] = p
                    found += 1
        self.count[None] = found

    @ti.kernel
    def end(self, dt: float):
        """Put it back so that `x += dt v` of the mover ends where the substeps ended, pressure's change added."""
        for s in range(self.count[None]):
            i = self.row[s]
            self.x[i] = ti.cast(self.point[s].x - dt * self.point[s].v, float)
            self.v[i] = ti.cast(self.point[s].v, float) - dt * self.pressure_acceleration[i]
            self.triangle[i] = self.point[s].triangle

    @ti.func
    def predict(self, h):
        """Gravity, terms and last step's pressure; then the free move."""
        self.elapsed[None] += h
        for s in range(self.count[None]):
            self.point[s].v += h * self.point[s].a
            self.point[s].start = self.point[s].x
            self.point[s].x += h * self.point[s].v

    @ti.func
    def project(self, h):
        """One sweep over all contacts."""
        for s in range(self.count[None]):
            p = self.point[s]
            rest = ti.min(OFFSET * self.dx, p.gap + PUSH_OUT * self.elapsed[None])
            t, n, gap, b, over = self._walk(p.x, p.triangle, p.side)
            p.triangle, p.push = t, 0.0
            if gap < rest and over:
                corner = self.sheet.corner[t]
                w = p.w
                for k in ti.static(range(3)):
                    w += b[k] * b[k] * self.cloth.weight(corner[k])
                p.push = (rest - gap) / w
                p.x += p.w * p.push * n
                for k in ti.static(range(3)):
                    self.cloth.shift(corner[k], -self.cloth.weight(corner[k]) * b[k] * p.push * n)
                    impulse = ti.cast(b[k] * p.push / h, float)
                    if p.side > 0.0:
                        self.push_front[corner[k]] += impulse
                    else:
                        self.push_back[corner[k]] += impulse
                self.touched[None] = 1
            self.point[s] = p

    @ti.func
    def finish(self, h):
        """Velocities; friction and restitution of those in contact."""
        for s in range(self.count[None]):
            p = self.point[s]
            v_free = p.v
            p.v = (p.x - p.start) / h
            if p.push > 0.0:
                p.v += self._rub(p, v_free, h)
            self.point[s] = p

    @ti.func
    def _plane(self, x, t, side):
        """(normal towards `side`, gap, weights) over triangle t as it stands in this substep."""
        c = self.sheet.corner[t]
        n, height, w = plane_gap(x, self.cloth.position(c[0]), self.cloth.position(c[1]), self.cloth.position(c[2]))
        return side * n, side * height, w

    @ti.func
    def _walk(self, x, t, side):
        """Follow the projection of x over at most two edges: (triangle, normal, gap, weights, over the sheet?)."""
        now = t
        n, gap, w = self._plane(x, now, side)
        over = True
        for _ in range(2):
            if w.min() < 0.0 and over:
                k = 0
                if w[1] < w[0]:
                    k = 1
                if w[2] < w[k]:
                    k = 2
                if self.sheet.beside[now][k] < 0:
                    over = False
                else:
                    now = self.sheet.beside[now][k]
                    n, gap, w = self._plane(x, now, side)
        w = ti.max(w, 0.0)
        return now, n, gap, w / w.sum(), over

    @ti.func
    def _rub(self, p, v_free, h):
        """Change of the point's velocity by Coulomb friction and restitution; the sheet gets the opposite impulse."""
        corner = self.sheet.corner[p.triangle]
        n, _gap, b = self._plane(p.x, p.triangle, p.side)
        b = ti.max(b, 0.0)
        b /= b.sum()
        w = p.w
        v_sheet = ti.Vector([0.0, 0.0, 0.0], self.real)
        for k in ti.static(range(3)):
            w += b[k] * b[k] * self.cloth.weight(corner[k])
            v_sheet += b[k] * self.cloth.velocity(corner[k])
        r = p.v - v_sheet
        tangent = r - r.dot(n) * n
        speed = tangent.norm()
        impulse = ti.Vector([0.0, 0.0, 0.0], self.real)
        if speed > 0.0:
            impulse = -ti.min(speed / w, self.friction * p.push / h) / speed * tangent
        if ti.static(self.restitution > 0.0):
            arriving = (v_free - v_sheet).dot(n)
            if arriving < -4.0 * PUSH_OUT:
                impulse += ti.max(-self.restitution * arriving - r.dot(n), 0.0) / w * n
        for k in ti.static(range(3)):
            self.cloth.push(corner[k], -self.cloth.weight(corner[k]) * b[k] * impulse)
        return p.w * impulse
