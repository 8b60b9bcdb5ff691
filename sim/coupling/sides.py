"""On which side of the sheet is each particle; pairs that the sheet separates leave the list (Guendelman 2005)."""

import taichi as ti
import taichi.math as tm

from sim.coupling.sheet import ROUNDING
from sim.maths.facet import closest_barycentric
from sim.runtime import TURNS
from sim.search.boxes import overlap

RUN, RUNS = 16, 8
"""Rows whose box looks for the sheet before they do, and such runs that a thread goes through in a go."""


@ti.data_oriented
class Sides:
    """Nearest triangle, side, and the cut of pairs. reads fluid.x, cloth.x; writes fluid.triangle, fluid.side.

    gap (n,)   at the step's start no triangle was nearer than this, to 0.1 % [m]
    """

    def __init__(self, build, sheet, boxes, reach: float):
        state = build.state
        self.count, self.x, self.id = state.count, state["fluid.x"], state["fluid.id"]
        self.triangle, self.side = state["fluid.triangle"], state["fluid.side"]
        self.pairs = build.parts["pairs"]
        self.sheet, self.boxes, self.reach = sheet, boxes, reach
        self.gap = ti.field(float, shape=state.sizes["fluid"])

    def run(self, dt: float) -> None:
        """Find sides on the positions that the pair list belongs to, then cut."""
        self.sheet.begin()
        self.boxes.refit(self.sheet.low, self.sheet.high)
        if self._find():
            self._cut(self.pairs.neighbour, self.pairs.weight, self.pairs.slope)

    @ti.kernel
    def _find(self) -> ti.i32:
        """Nearest triangle, gap and side; returns whether there is water on more than one side.

        Rows that follow each other lie together: where their box is far from the sheet, they are not asked one by one.
        """
        least, most = 1, -1
        for turn in range((self.count[None] + RUN - 1) // RUN * TURNS // RUNS):
            if turn % (TURNS // RUNS) == 0:
                first = turn // (TURNS // RUNS) * RUN
                end = ti.min(first + RUN, self.count[None])
                low, high, near = self.x[first], self.x[first], False
                for i in range(first, end):
                    low, high = ti.min(low, self.x[i]), ti.max(high, self.x[i])
                    near |= self.triangle[i] >= 0
                for k in range(first - 1, end):  # one walk in the code, for it is dear to compile: first of the box
                    i = ti.max(k, first)
                    if k >= first:
                        low, high = self.x[i], self.x[i]
                    if near == (k >= first):
                        nearest, gap, weights = self._nearest(low, high, self.triangle[i], k >= first)
                        if k < first:
                            near = gap < self.reach
                        else:
                            self.triangle[i], self.gap[i] = nearest, gap
                            side = 0
                            if nearest >= 0:
                                side = self._side(low, nearest, weights)
                                ti.atomic_min(least, side)
                                ti.atomic_max(most, side)
                            self.side[i] = side
                    elif k >= first:
                        self.triangle[i], self.gap[i], self.side[i] = -1, self.reach, 0
        return least < most

    @ti.func
    def _nearest(self, low, high, hint, single):
        """(nearest triangle within reach or -1, gap, weights of the nearest place) of a single place; of a box only
        the gap, 0 if it is less than the reach. Last step's triangle goes first and prunes the rest; ties go to the
        lower number, so that where one began makes no difference."""
        best, nearest, weights = self.reach * self.reach, -1, tm.vec3(0.0)
        if single and hint >= 0:
            best, nearest, weights = self._nearer(low, hint, best, nearest, weights)
        within, vague = ti.sqrt(best) + ROUNDING, best
        walk = self.boxes.begin(low - within, high + within)
        while walk[0] < walk[1]:
            walk, first, last = self.boxes.next(walk, low - within, high + within)
            for s in range(first, last):
                p = self.boxes.slots[s]
                outside = ti.max(self.sheet.low[p] - high, low - self.sheet.high[p], 0.0)
                if outside.norm_sqr() <= best:
                    if single:
                        for t in range(2 * p, 2 * p + 2):
                            if self.sheet.is_sliver(t):
                                vague = ti.min(vague, outside.norm_sqr())
                            if t != hint:
                                best, nearest, weights = self._nearer(low, t, best, nearest, weights)
                    else:
                        best, walk[0] = 0.0, walk[1]
        return nearest, ti.sqrt(ti.min(best, vague)), weights

    @ti.func
    def _nearer(self, x, t, best, nearest, weights):
        """The better of the best so far and triangle t."""
        a, b, c = self.sheet.points(t)
        w = closest_barycentric(x, a, b, c)
        r = x - (w[0] * a + w[1] * b + w[2] * c)
        d, n, v = best, nearest, weights
        if r.norm_sqr() < best or (r.norm_sqr() == best and t < nearest):
            d, n, v = r.norm_sqr(), t, w
        return d, n, v

    @ti.func
    def _side(self, x, t, w):
        """By the normal interpolated between nodes, which is right at edges and corners too; 0 beyond a hem."""
        corner, beside = self.sheet.corner[t], self.sheet.beside[t]
        a, b, c = self.sheet.points(t)
        r = x - (w[0] * a + w[1] * b + w[2] * c)
        face = (b - a).cross(c - a).normalized(1e-30)
        normal = face
        inside = w[0] > 0.0 and w[1] > 0.0 and w[2] > 0.0
        side = 0
        if not inside:
            normal = tm.vec3(0.0)
            for k in ti.static(range(3)):
                if w[k] > 0.0:
                    normal += w[k] * self.sheet.node_normal(corner[k])
        if r.dot(normal) > 0.0:
            side = 1
        elif r.dot(normal) < 0.0:
            side = -1
        tangential = r - r.dot(face) * face
        for k in ti.static(range(3)):
            if w[k] <= 0.0 and beside[k] < 0 and tangential.norm_sqr() > 0.01 * r.norm_sqr():
                side = 0
        return side

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
        grown = self.sheet.moved[None] + ROUNDING
        low, high = ti.min(x, y) - grown, ti.max(x, y) + grown
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
