"""The sheet as water meets it: triangles, who is beside whom, boxes of patches, how far it has moved in the step."""

import numpy as np
import taichi as ti
import taichi.math as tm

from sim import runtime
from sim.maths.order import less, more
from sim.registry import method
from sim.search.boxes import overlap

SLIVER = 1e-3
"""[1] A triangle is one whose doubled area squared is no more of its longest side to the fourth: 3 % of that high."""
EVERYWHERE = 1e30
"""[m] Room that nothing goes beyond."""
LOOK = 4
"""Particles that are looked at in the time that it takes to sort the box of a patch."""
MORE = 1.002
"""[1] Ways are taken for so much longer than they are, where they are held against gaps, known to 0.1 %."""
ROUNDING = 1e-6
"""[m] What boxes are grown by, so that no f32 loses a contact."""


@ti.data_oriented
class SheetGeometry:
    """Geometry of the cloth over one step: x0 at its start, x now.

    corner (t,) ivec3      nodes of each triangle; patch p owns triangles 2p and 2p + 1
    quad (p,) ivec4        the four corners of each patch
    beside (t,) ivec3      triangle across the edge opposite corner k; -1 at a hem
    low, high (p,) vec3    box of a patch at the step's start, a rounding larger [m]
    boxes                  the search over them, see sim.search.boxes
    near (p,) i32          0 where its box is so far from all water that nobody meets it; None: all are near
    room () f              what goes no farther than this meets only what is near; else `widen` [m]
    drift () vec3          way that the sheet near the water goes in the step: the middle of its nodes' ways [m]
    spread () f            how far their ways are from that, at most [m]
    moved () f             how far any node of the sheet goes, at most [m]
    hem (p,) i32           1 where the patch lies within `reach` of a hem
    """

    def __init__(self, build, reach: float):
        sheet = build.scene.sheet
        triangles = np.asarray(sheet.triangles, np.int32)
        self.x = build.state["cloth.x"]
        node_count, self.patch_count = len(sheet.x), len(sheet.patches)
        self.x0 = ti.Vector.field(3, float, shape=node_count)
        self.moved, self.spread, self.room = (ti.field(float, shape=()) for _ in range(3))
        self.drift = ti.Vector.field(3, float, shape=())
        self.rows, self.count, self.reach = build.state["fluid.x"], build.state.count, reach
        self.few = runtime.few(node_count // 2)
        self.corner, self.beside = _field(triangles), _field(neighbours(triangles))
        self.quad = _field(np.asarray(sheet.patches))
        self.low = ti.Vector.field(3, float, shape=self.patch_count)
        self.high = ti.Vector.field(3, float, shape=self.patch_count)
        self.boxes = method("search.boxes", build.config.coupling.search)(self.patch_count)
        self.narrows = self.boxes.leaves_out and LOOK * self.patch_count > build.state.sizes["fluid"]
        self.near = ti.field(ti.i32, shape=self.patch_count) if self.narrows else None
        self.water = ti.Vector.field(3, float, shape=2)
        self.hem = ti.field(ti.i32, shape=self.patch_count)
        self.hem.from_numpy(_near_hem(sheet, reach).astype(np.int32))
        around, start = triangles_of_nodes(triangles, node_count)
        self.around = ti.field(ti.i32, shape=len(around))
        self.around.from_numpy(around)
        self.around_start = ti.field(ti.i32, shape=node_count + 1)
        self.around_start.from_numpy(start)

    @ti.kernel
    def begin(self):
        """Remember where the sheet stands, the boxes of its patches, and which of them are near water."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.moved[None], self.spread[None], self.drift[None] = 0.0, 0.0, tm.vec3(0.0)
            self.room[None] = EVERYWHERE
            if ti.static(self.narrows):
                self.room[None] = self.reach
                self._bound_water()
        ti.loop_config(serialize=self.few)
        for n in range(self.x.shape[0]):
            self.x0[n] = self.x[n]
        ti.loop_config(serialize=self.few)
        for p in range(self.patch_count):
            low, high = self.box(p)
            self.low[p], self.high[p] = low - ROUNDING, high + ROUNDING
            if ti.static(self.narrows):
                self.near[p] = ti.cast(overlap(low, high, self.water[0], self.water[1]), ti.i32)

    @ti.func
    def _bound_water(self):
        """The box of all particles, larger by two `reach`: by one that they see, and by one that they or it may go."""
        low, high = tm.vec3(1e30), tm.vec3(-1e30)
        for i in range(self.count[None]):  # by ti.min: what is carried from turn to turn, less makes slower here
            low, high = ti.min(low, self.rows[i]), ti.max(high, self.rows[i])
        self.water[0], self.water[1] = low - 2.0 * self.reach, high + 2.0 * self.reach

    def sort(self) -> None:
        """Boxes for the search, those near water."""
        self.boxes.refit(self.low, self.high, *([self.near] if self.narrows else []))

    def widen(self) -> None:
        """All boxes for the search: something went farther than there is room for."""
        self.near.fill(1)
        self.room[None] = EVERYWHERE
        self.sort()

    @ti.func
    def follow(self):
        """Note how far the sheet has gone."""
        farthest, low, high = 0.0, tm.vec3(1e30), tm.vec3(-1e30)
        for n in range(self.x.shape[0]):
            way = self.x[n] - self.x0[n]
            farthest = more(farthest, way.norm_sqr())
            if ti.static(not self.narrows):
                low, high = less(low, way), more(high, way)
        if ti.static(self.narrows):
            for p in range(self.patch_count):
                if self.near[p]:
                    for k in ti.static(range(4)):
                        n = self.quad[p][k]
                        low, high = less(low, self.x[n] - self.x0[n]), more(high, self.x[n] - self.x0[n])
        self.moved[None] = MORE * ti.sqrt(farthest)
        self.drift[None], self.spread[None] = tm.vec3(0.0), 0.0
        if low[0] <= high[0]:
            self.drift[None] = 0.5 * (low + high)
            self.spread[None] = 0.5 * MORE * (high - low).norm()

    @ti.func
    def swept(self, x0, x1):
        """The box that the boxes of patches at the step's start overlap, if on the way x0 -> x1 they may be met."""
        grown = self.spread[None] + ROUNDING
        end = x1 - self.drift[None]
        return less(x0, end) - grown, more(x0, end) + grown

    @ti.func
    def may_meet(self, p, x0, x1, gap):
        """Whether the way x0 -> x1 can meet patch p on its own: seen from a corner of p, who stood `gap` off the sheet
        and so far off p's box as it did must come as far."""
        at = self.quad[p]
        way, spread_sq = self.x[at[0]] - self.x0[at[0]], 0.0
        for k in ti.static(range(1, 4)):
            spread_sq = ti.max(spread_sq, (self.x[at[k]] - self.x0[at[k]] - way).norm_sqr())
        outside = ti.max(self.low[p] - x0, x0 - self.high[p], 0.0)
        comes = MORE * ((x1 - x0 - way).norm() + ti.sqrt(spread_sq)) + ROUNDING
        return ti.max(outside.norm_sqr(), gap * gap) <= comes * comes

    @ti.func
    def box(self, p):
        at = self.quad[p]
        low, high = self.x[at[0]], self.x[at[0]]
        for k in ti.static(range(1, 4)):
            low, high = less(low, self.x[at[k]]), more(high, self.x[at[k]])
        return low, high

    @ti.func
    def points(self, t):
        """Corners of triangle t now."""
        c = self.corner[t]
        return self.x[c[0]], self.x[c[1]], self.x[c[2]]

    @ti.func
    def points_before(self, t):
        """Corners of triangle t at the start of the step."""
        c = self.corner[t]
        return self.x0[c[0]], self.x0[c[1]], self.x0[c[2]]

    @ti.func
    def node_normal(self, n):
        """Area-weighted unit normal of a node."""
        normal = tm.vec3(0.0)
        for s in range(self.around_start[n], self.around_start[n + 1]):
            a, b, c = self.points(self.around[s])
            normal += (b - a).cross(c - a)
        return normal.normalized(1e-30)

    @ti.func
    def face_normal(self, t):
        a, b, c = self.points(t)
        return (b - a).cross(c - a).normalized(1e-30)


@ti.func
def is_sliver(a, b, c):
    """Whether a triangle is so thin that f32 cannot tell how far off it is."""
    u, v = b - a, c - a
    uu, vv, uv = u.norm_sqr(), v.norm_sqr(), u.dot(v)
    longest = ti.max(uu, vv, uu + vv - 2.0 * uv)
    return uu * vv - uv * uv <= SLIVER * longest * longest


def neighbours(triangles: np.ndarray) -> np.ndarray:
    """(t, 3) i32: the triangle across the edge opposite each corner, -1 where there is none."""
    owner: dict[tuple[int, int], tuple[int, int]] = {}
    beside = np.full(triangles.shape, -1, np.int32)
    for t, corners in enumerate(triangles.tolist()):
        for k in range(3):
            edge = tuple(sorted((corners[(k + 1) % 3], corners[(k + 2) % 3])))
            if edge in owner:
                other, m = owner[edge]
                beside[t, k], beside[other, m] = other, t
            else:
                owner[edge] = (t, k)
    return beside


def triangles_of_nodes(triangles: np.ndarray, node_count: int) -> tuple[np.ndarray, np.ndarray]:
    """(flat list of triangles node by node, start (n + 1,)), both i32."""
    order = np.argsort(triangles.reshape(-1), kind="stable")
    counts = np.bincount(triangles.reshape(-1), minlength=node_count)
    return (order // 3).astype(np.int32), np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)


def _near_hem(sheet, reach: float) -> np.ndarray:
    """(p,) bool: some corner of the patch lies within `reach` [m] of a hem, along the unstretched sheet."""
    uv = sheet.uv
    to_hem = np.minimum(uv - uv.min(0), uv.max(0) - uv).min(1)
    return to_hem[sheet.patches].min(1) <= reach


def _field(values: np.ndarray):
    field = ti.Vector.field(values.shape[1], ti.i32, shape=len(values))
    field.from_numpy(values.astype(np.int32))
    return field
