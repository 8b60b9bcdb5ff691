"""The last step: after all has moved, no trajectory x0 -> x may cross a moving triangle. Expected never to act."""

import taichi as ti
import taichi.math as tm

from sim import runtime
from sim.maths.ccd import EXACT, first_hit
from sim.search.boxes import overlap

PASSES = 8
CLEARANCE = 0.05
"""[dx] A caught particle is put this far over the triangle, on its entry side."""


@ti.data_oriented
class Catch:
    """reads and writes fluid.x, fluid.v, cloth.v.

    acts, leaks: totals of particles caught, and of crossings that PASSES passes could not undo (0-D, i32).
    """

    def __init__(self, build, sheet, boxes):
        state = build.state
        self.state_count = state.count
        self.x, self.v, self.mass = state["fluid.x"], state["fluid.v"], state["fluid.mass"]
        self.node_v, self.node_w = state["cloth.v"], state["cloth.inv_mass"]
        self.sheet, self.boxes = sheet, boxes
        self.clearance = CLEARANCE * build.config.fluid.spacing
        capacity = state.sizes["fluid"]
        self.few = runtime.few(capacity)
        self.x0 = ti.Vector.field(3, float, shape=capacity)
        self.crossed = ti.field(ti.i32, shape=capacity)
        self.acts = ti.field(ti.i32, shape=())
        self.leaks = ti.field(ti.i32, shape=())

    @ti.kernel
    def begin(self):
        """Remember where each particle stands at the start of the step."""
        ti.loop_config(serialize=self.few)
        for i in range(self.state_count[None]):
            self.x0[i] = self.x[i]

    def run(self, dt: float) -> None:
        """Find who crossed, and put them back."""
        self.find()
        self._put_back()

    def find(self) -> None:
        """crossed[i] = the first triangle that x0 -> x passes, or -1."""
        self.sheet.bound_sweep(1e-6)
        self.boxes.refit(self.sheet.low, self.sheet.high)
        self._find()

    @ti.kernel
    def count_leaks(self):
        """All who crossed, for a contact that does not put them back."""
        for i in range(self.state_count[None]):
            self.leaks[None] += self.crossed[i] >= 0

    @ti.kernel
    def _find(self):
        for i in range(self.state_count[None]):
            t, _ = self.first_crossing(self.x0[i], self.x[i])
            self.crossed[i] = t

    @ti.func
    def first_crossing(self, x0, x1):
        """(triangle or -1, barycentric weights) of the first crossing of the moving sheet by x0 -> x1."""
        low, high = ti.min(x0, x1), ti.max(x0, x1)
        found = -1
        weights = tm.vec3(0.0)
        best = ti.cast(2.0, ti.f64)
        walk = self.boxes.begin(low, high)
        while walk[0] < walk[1]:
            walk, first, last = self.boxes.next(walk, low, high)
            for s in range(first, last):
                p = self.boxes.slots[s]
                if overlap(low, high, self.sheet.low[p], self.sheet.high[p]):
                    for t in range(2 * p, 2 * p + 2):
                        a0, b0, c0 = self.sheet.points_before(t)
                        a1, b1, c1 = self.sheet.points(t)
                        hit = first_hit(x0, x1, a0, a1, b0, b1, c0, c1, EXACT)
                        if hit[0] < best or (hit[0] == best and hit[0] <= 1.0 and t < found):
                            best, found = hit[0], t
                            w1, w2 = ti.cast(hit[1], float), ti.cast(hit[2], float)
                            weights = tm.vec3(1.0 - w1 - w2, w1, w2)
        return found, weights

    @ti.kernel
    def _put_back(self):
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            if self.crossed[i] >= 0:
                self.acts[None] += 1
                solved = False
                for attempt in range(PASSES + 1):
                    if not solved:
                        t, w = self.first_crossing(self.x0[i], self.x[i])
                        if t < 0:
                            solved = True
                        elif attempt < PASSES:
                            self._place(i, t, w)
                        else:
                            self.leaks[None] += 1

    @ti.func
    def _place(self, i, t, b):
        """Over the same barycentrics of the end triangle, on the entry side, without approaching velocity."""
        a0, b0, c0 = self.sheet.points_before(t)
        a1, b1, c1 = self.sheet.points(t)
        entry = (self.x0[i] - a0).dot((b0 - a0).cross(c0 - a0))
        n = self.sheet.face_normal(t)
        if entry < 0.0:
            n = -n
        self.x[i] = b[0] * a1 + b[1] * b1 + b[2] * c1 + self.clearance * n
        corner = self.sheet.corner[t]
        w = 1.0 / self.mass[i]
        r = self.v[i]
        for k in ti.static(range(3)):
            w += b[k] * b[k] * self.node_w[corner[k]]
            r -= b[k] * self.node_v[corner[k]]
        impulse = ti.max(-r.dot(n), 0.0) / w * n
        self.v[i] += impulse / self.mass[i]
        for k in ti.static(range(3)):
            self.node_v[corner[k]] -= self.node_w[corner[k]] * b[k] * impulse
