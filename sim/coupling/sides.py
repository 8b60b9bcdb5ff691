"""On which side of the sheet is each particle; pairs that the sheet separates leave the list (Guendelman 2005)."""

import taichi as ti
import taichi.math as tm

from sim.coupling.sheet import ROUNDING, is_sliver
from sim.maths.facet import closest_barycentric
from sim.maths.order import less, more
from sim.runtime import TURNS
from sim.search.boxes import overlap

RUN, RUNS = 16, 16
"""Rows that look for the sheet together, and such runs that a thread goes through in a go."""
WIDE = 2.5
"""[reach] Rows whose box is wider do not look together."""


@ti.data_oriented
class Sides:
    """Nearest triangle, side, and the cut of pairs. reads fluid.x, cloth.x; writes fluid.triangle, fluid.side.

    gap (n,)       at the step's start no triangle was nearer than this, to 0.1 % [m]
    weights (n,)   of the corners of the nearest triangle, where it is nearest
    vague (n,)     distance squared of the nearest box with a sliver in it, or the reach [m^2]
    """

    def __init__(self, build, sheet, reach: float):
        state = build.state
        self.count, self.x, self.id = state.count, state["fluid.x"], state["fluid.id"]
        self.triangle, self.side = state["fluid.triangle"], state["fluid.side"]
        self.pairs = build.parts["pairs"]
        self.sheet, self.boxes, self.reach = sheet, sheet.boxes, reach
        capacity = state.sizes["fluid"]
        self.gap, self.vague = (ti.field(float, shape=capacity) for _ in range(2))
        self.weights = ti.Vector.field(3, float, shape=capacity)

    def run(self, dt: float) -> None:
        """Find sides on the positions that the pair list belongs to, then cut."""
        self.sheet.begin()
        self.sheet.sort()
        if self._find():
            self._cut(self.pairs.neighbour, self.pairs.weight, self.pairs.slope)

    @ti.kernel
    def _find(self) -> ti.i32:
        """Nearest triangle, gap and side; returns whether there is water on more than one side.

        Rows that follow each other lie together, and walk through the boxes together.
        """
        least, most = 1, -1
        for turn in range((self.count[None] + RUN - 1) // RUN * TURNS // RUNS):
            if turn % (TURNS // RUNS) == 0:
                first = turn // (TURNS // RUNS) * RUN
                end = ti.min(first + RUN, self.count[None])
                while first < end:
                    last = self._stretch(first, end)
                    self._nearest(first, last)
                    for i in range(first, last):
                        self.gap[i] = ti.sqrt(ti.min(self.gap[i], self.vague[i]))
                        side = 0
                        if self.triangle[i] >= 0:
                            side = self._side(self.x[i], self.triangle[i], self.weights[i])
                            ti.atomic_min(least, side)
                            ti.atomic_max(most, side)
                        self.side[i] = side
                    first = last
        return least < most

    @ti.func
    def _stretch(self, first, end):
        """Where the rows from `first` on end that lie in a box that is not WIDE."""
        low, high, last, fits = self.x[first], self.x[first], first + 1, True
        while last < end and fits:
            low, high = less(low, self.x[last]), more(high, self.x[last])
            fits = (high - low).max() <= WIDE * self.reach
            last += fits
        return last

    @ti.func
    def _nearest(self, first, end):
        """Of rows that lie together: the nearest triangle within reach or -1, weights, and as `gap` its square.

        Last step's triangle goes first and prunes the rest; ties go to the lower number, so that where one began makes
        no difference.
        """
        low, high, farthest = self.x[first], self.x[first], 0.0
        for i in range(first, end):
            x, hint = self.x[i], self.triangle[i]
            low, high = less(low, x), more(high, x)
            self.gap[i], self.vague[i], self.triangle[i] = self.reach * self.reach, self.reach * self.reach, -1
            if hint >= 0:
                self._try(i, x, hint, 0.0)
            farthest = ti.max(farthest, self.gap[i])
        within = ti.sqrt(farthest) + ROUNDING
        walk = self.boxes.begin(low - within, high + within)
        while walk[0] < walk[1]:
            walk, start, stop = self.boxes.next(walk, low - within, high + within)
            for s in range(start, stop):
                p = self.boxes.slots[s]
                if more(more(self.sheet.low[p] - high, low - self.sheet.high[p]), 0.0).norm_sqr() <= farthest:
                    self._try_patch(p, first, end)

    @ti.func
    def _try_patch(self, p, first, end):
        """Both triangles of patch p, for the rows whose best so far is no nearer than its box."""
        a, b = self.sheet.low[p], self.sheet.high[p]
        for i in range(first, end):
            x = self.x[i]
            outside_sq = more(more(a - x, x - b), 0.0).norm_sqr()
            if outside_sq <= self.gap[i]:
                for t in range(2 * p, 2 * p + 2):
                    if t != self.triangle[i]:
                        self._try(i, x, t, outside_sq)

    @ti.func
    def _try(self, i, x, t, outside_sq):
        """Take triangle t if it is nearer than the best so far; of a sliver only its box tells how near it may be."""
        a, b, c = self.sheet.points(t)
        w = closest_barycentric(x, a, b, c)
        r = (x - (w[0] * a + w[1] * b + w[2] * c)).norm_sqr()
        if r < self.gap[i] or (r == self.gap[i] and t < self.triangle[i]):
            self.gap[i], self.triangle[i], self.weights[i] = r, t, w
        if is_sliver(a, b, c):
            self.vague[i] = ti.min(self.vague[i], outside_sq)

    @ti.func
    def _side(self, x, t, w):
        """By the normal interpolated between nodes, which is right at edges and corners too; 0 beyond a hem."""
        a, b, c = self.sheet.points(t)
        r, face = x - (w[0] * a + w[1] * b + w[2] * c), (b - a).cross(c - a)
        normal, beyond = face, False
        if ti.min(w[0], w[1], w[2]) <= 0.0:
            corner, beside, hem = self.sheet.corner[t], self.sheet.beside[t], False
            normal = tm.vec3(0.0)
            for k in ti.static(range(3)):
                if w[k] > 0.0:
                    normal += w[k] * self.sheet.node_normal(corner[k])
                else:
                    hem |= beside[k] < 0
            tangential = r - r.dot(face) / ti.max(face.norm_sqr(), 1e-30) * face
            beyond = hem and tangential.norm_sqr() > 0.01 * r.norm_sqr()
        out = r.dot(normal)
        return 0 if beyond else ti.cast(out > 0.0, ti.i32) - ti.cast(out < 0.0, ti.i32)

    @ti.kernel
    def _cut(self, neighbour: ti.template(), weight: ti.template(), slope: ti.template()):
        for i in range(self.count[None]):
            if self.triangle[i] >= 0:
                for k in range(self.pairs.start[i], self.pairs.stop[i]):
                    if self._separated(i, neighbour[k]):
                        weight[k] = 0.0
                        slope[k] = 0.0

    @ti.func
    def _separated(self, i, j):
        """The same answer for (i, j) and (j, i)."""
        s, t = self.side[i], self.side[j]
        cut = False
        if self.triangle[j] >= 0 and s != t:
            cut = True
            if s == 0 or t == 0 or self.sheet.hem[self.triangle[i] // 2] or self.sheet.hem[self.triangle[j] // 2]:
                u, v = i, j
                if self.id[i] > self.id[j]:
                    u, v = j, i
                cut = self.crosses(self.x[u], self.x[v])
        return cut

    @ti.func
    def crosses(self, x, y):
        """Does the segment x-y pass through the sheet as it stands?"""
        found = False
        low, high = self.sheet.swept(x - self.sheet.drift[None], y)  # of x and y now
        walk = self.boxes.begin(low, high)
        while walk[0] < walk[1] and not found:
            walk, first, last = self.boxes.next(walk, low, high)
            for s in range(first, last):
                p = self.boxes.slots[s]
                for t in range(2 * p, 2 * p + 2):
                    if not found and overlap(low, high, self.sheet.low[p], self.sheet.high[p]):
                        found = segment_hits(x, y, *self.sheet.points(t))
        return found


@ti.func
def segment_hits(x, y, a, b, c):
    """Does the open segment x-y cross the closed triangle abc (signs of volumes)?"""
    n = (b - a).cross(c - a)
    hit = False
    if (x - a).dot(n) * (y - a).dot(n) < 0.0:
        d = y - x
        u, v, w = d.cross(c - b).dot(b - x), d.cross(a - c).dot(c - x), d.cross(b - a).dot(a - x)
        hit = (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0)
    return hit
