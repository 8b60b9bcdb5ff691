"""After a step no two parts of the sheet may have passed through each other on their way. Expected seldom to act."""

import taichi as ti

from sim.cloth.elements import Elements
from sim.cloth.patch_pairs import PatchPairs
from sim.cloth.zones import join, root
from sim.errors import DivergedError
from sim.maths.ccd import EDGES, meets, shares, spanned

APART_PASSES = 6
"""Passes that part crossings one by one; then those left are carried together."""
PASSES = 60
"""Then the whole sheet waits where it was, for this one step."""
PARALLEL = 0.01
"""[rad] Edges at less than this are parted across the first of them."""


@ti.data_oriented
class LastStep:
    """Reads x0, cloth.inv_mass, writes cloth.x, cloth.v where a way x0 -> x meets another. parted, carried: totals.

    First each crossing is parted to `clearance` [m] on the side it came from, without approaching speed. What does
    not come free so is gathered into zones of nodes that touch; a zone moves as one, by its mean way: within it
    nothing can cross, and zones that meet become one (rigid impact zones without turning, Provot 1997).
    """

    def __init__(self, build, pairs: PatchPairs, elements: Elements, x0, clearance: float):
        self.pairs, self.elements, self.x0, self.clearance = pairs, elements, x0, clearance
        self.x, self.v, self.w = build.state["cloth.x"], build.state["cloth.v"], build.state["cloth.inv_mass"]
        self.node_count = n = x0.shape[0]
        self.zone, self.free = ti.field(ti.i32, n), ti.field(ti.i32, n)
        self.way, self.speed = ti.Vector.field(3, float, n), ti.Vector.field(3, float, n)
        self.total = ti.field(float, n)
        self.parted, self.carried = ti.field(ti.i32, ()), ti.field(ti.i32, ())
        self.mask = ti.field(ti.i64, 1)

    def run(self, dt: float) -> None:
        """Find what crossed, and undo it."""
        for attempt in range(PASSES):
            if self.mask.shape != self.pairs.partner.shape:
                self.mask = ti.field(ti.i64, self.pairs.partner.shape[0])
            given = (self.pairs.partner, self.pairs.room, self.mask)
            if not self._find(*given):
                return
            if attempt < APART_PASSES:
                self._part(*given)
            elif attempt < PASSES - 2:
                self._carry(*given, attempt == APART_PASSES)
            else:
                self._wait()
            self.pairs.cover(self.x0, self.clearance)
        raise DivergedError("the sheet crosses itself though it stands still; it did so when the step began")

    @ti.kernel
    def _find(self, partner: ti.template(), room: ti.i32, mask: ti.template()) -> ti.i32:
        """Mark the tests that hit; how many."""
        hits = 0
        for p in range(self.pairs.patch_count):
            for k in range(self.pairs.count[p]):
                q = partner[p * room + k]
                bits = ti.cast(0, ti.i64)
                for t in range(self.elements.count(p, q)):
                    kind, four, fits = self.elements.test(p, q, t)
                    if fits:
                        if self._crosses(kind, four):
                            bits |= ti.cast(1, ti.i64) << t
                            hits += 1
                mask[p * room + k] = bits
        return hits

    @ti.func
    def _crosses(self, kind, four):
        low = ti.min(self.x0[four[0]], self.x[four[0]])
        high = ti.max(self.x0[four[0]], self.x[four[0]])
        other_low = ti.min(self.x0[four[3]], self.x[four[3]])
        other_high = ti.max(self.x0[four[3]], self.x[four[3]])
        for k in ti.static((1, 2)):
            x_low, x_high = ti.min(self.x0[four[k]], self.x[four[k]]), ti.max(self.x0[four[k]], self.x[four[k]])
            if k == 1 and kind == EDGES:
                low, high = ti.min(low, x_low), ti.max(high, x_high)
            else:
                other_low, other_high = ti.min(other_low, x_low), ti.max(other_high, x_high)
        hit = False
        if ti.max(other_low - high, low - other_high).max() <= 0.0:
            hit = meets(kind, *self._four(self.x0, four), *self._four(self.x, four))
        return hit

    @ti.func
    def _four(self, x: ti.template(), four):
        """Their places, in f64: differences are exact there."""
        a, b, c, d = x[four[0]], x[four[1]], x[four[2]], x[four[3]]
        return ti.cast(a, ti.f64), ti.cast(b, ti.f64), ti.cast(c, ti.f64), ti.cast(d, ti.f64)

    @ti.kernel
    def _part(self, partner: ti.template(), room: ti.i32, mask: ti.template()):
        ti.loop_config(serialize=True)
        for p in range(self.pairs.patch_count):
            for k in range(self.pairs.count[p]):
                if mask[p * room + k] != 0:
                    q = partner[p * room + k]
                    for t in range(self.elements.count(p, q)):
                        if (mask[p * room + k] >> t) & 1:
                            kind, four, _ = self.elements.test(p, q, t)
                            self._put_apart(kind, four)
                            self.parted[None] += 1

    @ti.func
    def _put_apart(self, kind, four):
        """To the clearance over where they are nearest now, on the side on which they began."""
        q0, u0, v0 = spanned(kind, *self._four(self.x0, four))
        q, u, v = spanned(kind, *self._four(self.x, four))
        n = u.cross(v)
        one, two, found = shares(kind, q, u, v)
        if kind == EDGES and n.norm() <= PARALLEL * u.norm() * v.norm():  # no direction across both: as they lay before
            n = q0 - q0.dot(u0) / ti.max(u0.dot(u0), 1e-30) * u0
            one, two = q.dot(u) / ti.max(u.dot(u), 1e-30), 0.0
            if one < 0.0 or one > 1.0:
                one, two = (q + v).dot(u) / ti.max(u.dot(u), 1e-30), 1.0
        elif not found:
            one, two = 1.0 / 3.0, 1.0 / 3.0
        elif q0.dot(u0.cross(v0)) < 0.0:
            n = -n
        n /= ti.max(n.norm(), 1e-30)
        one, two = ti.min(ti.max(one, 0.0), 1.0), ti.min(ti.max(two, 0.0), 1.0)
        w = ti.Vector([1.0, 0.0, 0.0, 0.0], ti.f64)
        if kind == EDGES:
            w = ti.Vector([one - 1.0, -one, 1.0 - two, two])
        else:
            over = ti.max(one + two, 1.0)
            w = ti.Vector([1.0, (one + two) / over - 1.0, -one / over, -two / over])
        gap, speed, resist = ti.cast(0.0, ti.f64), ti.cast(0.0, ti.f64), ti.cast(1e-30, ti.f64)
        for k in ti.static(range(4)):
            gap += w[k] * n.dot(self.x[four[k]])
            speed += w[k] * n.dot(self.v[four[k]])
            resist += w[k] * w[k] * self.w[four[k]]
        push, brake = ti.max(self.clearance - gap, 0.0) / resist, ti.max(-speed, 0.0) / resist
        for k in ti.static(range(4)):
            share = w[k] * self.w[four[k]]
            self.x[four[k]] += ti.cast(share * push * n, float)
            self.v[four[k]] += ti.cast(share * brake * n, float)

    @ti.kernel
    def _carry(self, partner: ti.template(), room: ti.i32, mask: ti.template(), first: ti.i32):
        """Join what crosses into zones; each zone moves by its mean way, or as its clip does."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            if first:
                for n in range(self.node_count):
                    self.zone[n] = n
            for p in range(self.pairs.patch_count):
                for k in range(self.pairs.count[p]):
                    if mask[p * room + k] != 0:
                        q = partner[p * room + k]
                        for t in range(self.elements.count(p, q)):
                            if (mask[p * room + k] >> t) & 1:
                                _kind, four, _fits = self.elements.test(p, q, t)
                                for e in ti.static(range(1, 4)):
                                    join(self.zone, four[0], four[e])
                                self.carried[None] += 1
            self._gather()
            for n in range(self.node_count):
                z = root(self.zone, n)
                if self.free[z] > 1:
                    self.x[n] = self.x0[n] + self.way[z]
                    self.v[n] = self.speed[z] * (self.w[n] > 0.0)

    @ti.func
    def _gather(self):
        """Mean way and speed of each zone by mass; of one that a clip holds, the clip's. free: nodes in it."""
        for n in range(self.node_count):
            self.way[n], self.speed[n], self.total[n], self.free[n] = 0.0, 0.0, 0.0, 0
        for n in range(self.node_count):
            z = root(self.zone, n)
            self.free[z] += 1
            if self.w[n] > 0.0 and self.total[z] < 1e29:
                m = 1.0 / self.w[n]
                self.way[z] += m * (self.x[n] - self.x0[n])
                self.speed[z] += m * self.v[n]
                self.total[z] += m
            elif self.w[n] == 0.0:
                self.total[z] = 1e30
                self.way[z], self.speed[z] = 1e30 * (self.x[n] - self.x0[n]), 0.0
        for n in range(self.node_count):
            if self.total[n] > 0.0:
                self.way[n] /= self.total[n]
                self.speed[n] /= self.total[n]

    @ti.kernel
    def _wait(self):
        for n in self.x:
            self.x[n] = self.x0[n]
            self.v[n] = 0.0
