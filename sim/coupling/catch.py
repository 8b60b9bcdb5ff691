"""The last step: after all has moved, no trajectory x0 -> x may cross a moving triangle. Expected never to act."""

import taichi as ti
import taichi.math as tm

from sim import runtime
from sim.cloth.zones import join, root
from sim.coupling.sheet import MORE, ROUNDING
from sim.maths.ccd import EXACT, first_hit
from sim.search.boxes import overlap

PASSES = 8
"""Of putting one particle back, each half as far over the triangle as the one before: folds may be near."""
HOLDS = 32
"""Of tying what is pinched, what that pinches, and so on; then the whole step waits. Water at 100 m/s in folds of
0.1 mm took more than 12."""
SHORT = 1e-4
"""[s] Steps no longer than this, a substep of the cloth, are not gone in halves: what is pinched in them is tied."""
GRAIN = 2.0**-22
"""[m] Ties move in whole ones of these: places of less than 4 m keep their distances to the bit, but where one passes a
power of two."""
CLIP = 1e20
"""[kg] A held node weighs as much as moves for nobody."""
CLEARANCE = 0.05
"""[dx] A caught particle is put this far over the triangle, on its entry side."""


@ti.data_oriented
class Catch:
    """reads and writes fluid.x, fluid.v, cloth.x, cloth.v.

    gap: how far each particle was from the sheet as the step began, or less (see sim.coupling.sides). Who went no
    farther, seen from the sheet, is not asked. A particle that crossed is put over the end triangle. If no place is
    found for one, it is pinched, and the step is taken back, to be gone anew in halves: water and sheet stand and move
    as they did before it, but for the pinched and their triangles, which go on with their mean velocity. (To hold only
    these back tears at the sheet: 6 mm in a substep are 60 m/s.) In a SHORT step they are tied instead: what is
    pinched, the triangles about it and all that these pinch go one way, their mean, with one speed, so that they cannot
    cross (as rigid impact zones, Provot 1997). Not where the sheet feels itself: its layers keep room between them, and
    ties might move one through another.

    acts, undone, tied, leaks: totals of particles caught, once each in a step, of steps taken back, of particles tied,
    and of crossings left (0-D, i32).
    """

    def __init__(self, build, sheet, gap):
        state = build.state
        self.state_count = state.count
        self.x, self.v, self.mass = state["fluid.x"], state["fluid.v"], state["fluid.mass"]
        self.node_v, self.node_w = state["cloth.v"], state["cloth.inv_mass"]
        self.node_v0 = ti.Vector.field(3, float, shape=self.node_v.shape)
        self.sheet, self.boxes, self.gap = sheet, sheet.boxes, gap
        self.clearance = CLEARANCE * build.config.fluid.spacing
        capacity = state.sizes["fluid"]
        self.few = runtime.few(capacity // 5)
        self.ties = build.config.cloth.self_contact is None
        self.x0 = ti.Vector.field(3, float, shape=capacity)
        self.v0 = ti.Vector.field(3, float, shape=capacity)
        self.crossed, self.acted, self.suspect = (ti.field(ti.i32, shape=capacity) for _ in range(3))
        self.acts, self.undone, self.tied, self.leaks = (ti.field(ti.i32, shape=()) for _ in range(4))
        nodes = self.node_v.shape[0]
        self.tie, self.zone = ti.field(ti.i32, shape=capacity), ti.field(ti.i32, shape=nodes)
        self.size, self.total = ti.field(ti.i32, shape=nodes), ti.field(float, shape=nodes)
        self.way, self.speed = (ti.Vector.field(3, float, shape=nodes) for _ in range(2))

    def totals(self) -> dict:
        """The counters by the names that a run tells them under."""
        return {"leaks": self.leaks, "caught": self.acts, "undone": self.undone, "tied": self.tied}

    @ti.kernel
    def begin(self):
        """Remember where each particle stands, and how all moves, at the start of the step."""
        ti.loop_config(serialize=self.few)
        for i in range(self.state_count[None]):
            self.x0[i] = self.x[i]
            self.v0[i] = self.v[i]
        ti.loop_config(serialize=self.few)
        for n in range(self.node_v.shape[0]):
            self.node_v0[n] = self.node_v[n]

    def run(self, dt: float) -> bool:
        """Find who crossed, and put them back. True if the whole step had to be taken back."""
        if not self.find():
            return False
        self._untie()
        pinched = self._put_back() > 0
        if pinched and dt <= SHORT and self.ties:
            pinched = not self._hold()
        if pinched:
            self._take_back()
            self.find()
            self.count_leaks()
        return pinched

    def _hold(self) -> bool:
        """Tie what is pinched until nothing crosses; whether that came about."""
        for _ in range(HOLDS):
            self._carry()
            self.find()
            if not self._put_back():
                return True
        return False

    @ti.kernel
    def _untie(self):
        """Nobody has been caught yet in this step."""
        for i in range(self.state_count[None]):
            self.tie[i], self.acted[i] = -1, 0
        for n in range(self.zone.shape[0]):
            self.zone[n] = n

    def find(self) -> int:
        """crossed[i] = the first triangle that x0 -> x passes, or -1; returns how many there are."""
        suspects = self._suspect()
        if suspects < 0:
            self.sheet.widen()
            suspects = self._suspect()
        return self._ask(suspects) if suspects else 0

    @ti.kernel
    def _suspect(self) -> ti.i32:
        """List those who went so far that they may have crossed, and return their number; -1 where something went
        farther than there is room for."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.sheet.follow()
        suspects, beyond = 0, 0
        ti.loop_config(serialize=self.few)
        for i in range(self.state_count[None]):
            way = self.x[i] - self.x0[i]
            room = self.sheet.room[None] - self.sheet.moved[None]
            own, free = MORE * (way - self.sheet.drift[None]), self.gap[i] - self.sheet.spread[None] - ROUNDING
            self.crossed[i] = -1
            if free <= 0.0 or free * free <= own.norm_sqr():
                self.suspect[ti.atomic_add(suspects, 1)] = i
            if room < 0.0 or way.norm_sqr() > room * room:
                beyond = 1
        return -1 if beyond else suspects

    @ti.kernel
    def _ask(self, suspects: ti.i32) -> ti.i32:
        count = 0
        for s in range(suspects):
            i = self.suspect[s]
            self.crossed[i], _, _w = self.first_crossing(i)
            count += self.crossed[i] >= 0
        return count

    @ti.kernel
    def count_leaks(self):
        """All who crossed."""
        for i in range(self.state_count[None]):
            self.leaks[None] += self.crossed[i] >= 0

    @ti.func
    def first_crossing(self, i):
        """(triangle or -1, time 0..1, barycentric weights) of particle i's first crossing of the moving sheet."""
        x0, x1, gap = self.x0[i], self.x[i], self.gap[i]
        found = -1
        weights = tm.vec3(0.0)
        best = ti.cast(2.0, ti.f64)
        low, high = self.sheet.swept(x0, x1)
        walk = self.boxes.begin(low, high)
        while walk[0] < walk[1]:
            walk, first, last = self.boxes.next(walk, low, high)
            for s in range(first, last):
                p = self.boxes.slots[s]
                if overlap(low, high, self.sheet.low[p], self.sheet.high[p]) and self.sheet.may_meet(p, x0, x1, gap):
                    for t in range(2 * p, 2 * p + 2):
                        a0, b0, c0 = self.sheet.points_before(t)
                        a1, b1, c1 = self.sheet.points(t)
                        hit = first_hit(x0, x1, a0, a1, b0, b1, c0, c1, EXACT)
                        if hit[0] < best or (hit[0] == best and hit[0] <= 1.0 and t < found):
                            best, found = hit[0], t
                            w1, w2 = ti.cast(hit[1], float), ti.cast(hit[2], float)
                            weights = tm.vec3(1.0 - w1 - w2, w1, w2)
        return found, ti.cast(best, float), weights

    @ti.kernel
    def _put_back(self) -> ti.i32:
        """Those that crossed go back to their side; crossed is left for those that could not. Returns their number."""
        pinched = 0
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            if self.crossed[i] >= 0:
                self.acts[None] += 1 - self.acted[i]
                self.acted[i] = 1
                attempt = 0 if self.tie[i] < 0 else PASSES
                while self.crossed[i] >= 0 and attempt < PASSES:
                    t, time, w = self.first_crossing(i)
                    self.crossed[i] = t
                    if t >= 0:
                        self._place(i, t, time, w, self.clearance * 0.5**attempt)
                    attempt += 1
                pinched += self.crossed[i] >= 0
        return pinched

    @ti.func
    def _place(self, i, t, time, b, clearance):
        """Over the same barycentrics of the end triangle, on the side it came from, without approaching velocity."""
        a0, b0, c0 = self.sheet.points_before(t)
        a1, b1, c1 = self.sheet.points(t)
        step = self.x[i] - self.x0[i] - (b[0] * (a1 - a0) + b[1] * (b1 - b0) + b[2] * (c1 - c0))
        a, u, v = tm.mix(a0, a1, time), tm.mix(b0, b1, time), tm.mix(c0, c1, time)
        arriving = step.dot((u - a).cross(v - a))
        if arriving == 0.0:
            arriving = -(self.x0[i] - a0).dot((b0 - a0).cross(c0 - a0))
        n = self.sheet.face_normal(t)
        if arriving > 0.0:
            n = -n
        self.x[i] = b[0] * a1 + b[1] * b1 + b[2] * c1 + clearance * n
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

    @ti.kernel
    def _carry(self):
        """Tie each particle left with the triangle that it crosses; all that hangs together goes its mean way."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            for i in range(self.state_count[None]):
                if self.crossed[i] >= 0:
                    corner = self.sheet.corner[self.crossed[i]]
                    self.tied[None] += self.tie[i] < 0
                    if self.tie[i] < 0:
                        self.tie[i] = corner[0]
                    for k in range(3):
                        join(self.zone, self.tie[i], corner[k])
            self._mean()
            for n in range(self.zone.shape[0]):
                z = root(self.zone, n)
                if self.size[z] > 1:
                    self.sheet.x[n] = self.sheet.x0[n] + self.way[z]
                    self.node_v[n] = self.speed[z] * (self.node_w[n] > 0.0)
            for i in range(self.state_count[None]):
                if self.tie[i] >= 0:
                    z = root(self.zone, self.tie[i])
                    self.x[i], self.v[i] = self.x0[i] + self.way[z], self.speed[z]

    @ti.func
    def _mean(self):
        """Way and speed of each zone, by mass; one that a clip holds goes as the clip does."""
        for n in range(self.zone.shape[0]):
            self.way[n], self.speed[n], self.total[n], self.size[n] = 0.0, 0.0, 0.0, 0
        for n in range(self.zone.shape[0]):
            z, m = root(self.zone, n), CLIP
            if self.node_w[n] > 0.0:
                m = 1.0 / self.node_w[n]
            self.size[z] += 1
            self._add(z, m, self.sheet.x[n] - self.sheet.x0[n], self.node_v[n])
        for i in range(self.state_count[None]):
            if self.tie[i] >= 0:
                self._add(root(self.zone, self.tie[i]), self.mass[i], self.x[i] - self.x0[i], self.v[i])
        for n in range(self.zone.shape[0]):
            self.way[n] = ti.round(self.way[n] / (ti.max(self.total[n], 1e-30) * GRAIN)) * GRAIN
            self.speed[n] /= ti.max(self.total[n], 1e-30)

    @ti.func
    def _add(self, z, m, way, speed):
        self.total[z] += m
        self.way[z] += m * way
        self.speed[z] += m * speed

    @ti.kernel
    def _take_back(self):
        """Everything as the step began; then each pinched particle and its triangle share their momentum."""
        self.undone[None] += 1
        for i in range(self.state_count[None]):
            self.x[i] = self.x0[i]
            self.v[i] = self.v0[i]
        for n in range(self.sheet.x.shape[0]):
            self.sheet.x[n] = self.sheet.x0[n]
            self.node_v[n] = self.node_v0[n]
        ti.loop_config(serialize=True)
        for i in range(self.state_count[None]):
            if self.crossed[i] >= 0:
                self._share_momentum(i, self.sheet.corner[self.crossed[i]])

    @ti.func
    def _share_momentum(self, i, corner):
        mass, momentum, pinned = self.mass[i], self.mass[i] * self.v[i], False
        for k in ti.static(range(3)):
            w = self.node_w[corner[k]]
            if w > 0.0:
                mass += 1.0 / w
                momentum += self.node_v[corner[k]] / w
            else:
                pinned = True
        mean = momentum / mass
        if pinned:
            mean = tm.vec3(0.0)
        self.v[i] = mean
        for k in ti.static(range(3)):
            if self.node_w[corner[k]] > 0.0:
                self.node_v[corner[k]] = mean
