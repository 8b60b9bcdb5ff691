"""On which side of the sheet is each particle; pairs that the sheet separates leave the list (Guendelman 2005)."""

import taichi as ti
import taichi.math as tm

from sim.maths.facet import closest_barycentric


@ti.data_oriented
class Sides:
    """Nearest triangle, side, and the cut of pairs. reads fluid.x, cloth.x; writes fluid.triangle, fluid.side."""

    def __init__(self, build, sheet, boxes, reach: float):
        state = build.state
        self.count, self.x, self.id = state.count, state["fluid.x"], state["fluid.id"]
        self.triangle, self.side = state["fluid.triangle"], state["fluid.side"]
        self.pairs = build.parts["pairs"]
        self.sheet, self.boxes, self.reach = sheet, boxes, reach

    def run(self, dt: float) -> None:
        """Find sides on the positions that the pair list belongs to, then cut."""
        self.sheet.begin(self.reach)
        self.boxes.refit(self.sheet.low, self.sheet.high)
        self._find()
        self._cut(self.pairs.neighbour, self.pairs.weight, self.pairs.slope)

    @ti.kernel
    def _find(self):
        for i in range(self.count[None]):
            x = self.x[i]
            best, nearest, weights = self.reach * self.reach, -1, tm.vec3(0.0)
            if 0 <= self.triangle[i]:
                best, nearest, weights = self._nearer(x, self.triangle[i], best, nearest, weights)
            walk = self.boxes.begin(x, x)
            while walk[0] < walk[1]:
                walk, first, last = self.boxes.next(walk, x, x)
                for s in range(first, last):
                    p = self.boxes.slots[s]
                    outside = ti.max(self.sheet.low[p] + self.reach - x, x - self.sheet.high[p] + self.reach, 0.0)
                    if outside.dot(outside) <= best:
                        for t in range(2 * p, 2 * p + 2):
                            best, nearest, weights = self._nearer(x, t, best, nearest, weights)
            self.triangle[i] = nearest
            self.side[i] = 0
            if nearest >= 0:
                self.side[i] = self._side(x, nearest, weights)

    @ti.func
    def _nearer(self, x, t, best, nearest, weights):
        """The better of the best so far and triangle t. Last step's triangle goes first and prunes the rest; ties go
        to the lower number, so that where one began makes no difference."""
        a, b, c = self.sheet.points(t)
        w = closest_barycentric(x, a, b, c)
        r = x - (w[0] * a + w[1] * b + w[2] * c)
        d, n, v = best, nearest, weights
        if r.dot(r) < best or (r.dot(r) == best and t < nearest):
            d, n, v = r.dot(r), t, w
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
                normal += w[k] * self.sheet.normal[corner[k]]
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
        """Does the segment x-y pass through the sheet as it stands? For points within the boxes last built."""
        found = False
        low, high = ti.min(x, y), ti.max(x, y)
        walk = self.boxes.begin(low, high)
        while walk[0] < walk[1] and not found:
            walk, first, last = self.boxes.next(walk, low, high)
            for s in range(first, last):
                p = self.boxes.slots[s]
                for t in range(2 * p, 2 * p + 2):
                    if not found:
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
