"""The sheet as water meets it: triangles, who is beside whom, boxes of patches, normals of nodes."""

import numpy as np
import taichi as ti
import taichi.math as tm

from sim import runtime


@ti.data_oriented
class SheetGeometry:
    """Geometry of the cloth over one step: x0 at its start, x now.

    corner (t,) ivec3      nodes of each triangle; patch p owns triangles 2p and 2p + 1
    beside (t,) ivec3      triangle across the edge opposite corner k; -1 at a hem
    low, high (p,) vec3    box of a patch, as `bound_reach` or `bound_sweep` last left it [m]
    normal (n,) vec3       area-weighted unit normal of a node
    hem (p,) i32           1 where the patch lies within `reach` of a hem
    """

    def __init__(self, build, reach: float):
        sheet = build.scene.sheet
        triangles = np.asarray(sheet.triangles, np.int32)
        self.x = build.state["cloth.x"]
        node_count, self.patch_count = len(sheet.x), len(sheet.patches)
        self.x0 = ti.Vector.field(3, float, shape=node_count)
        self.normal = ti.Vector.field(3, float, shape=node_count)
        self.few = runtime.few(8 * node_count)
        self.corner = _ivec3_field(triangles)
        self.beside = _ivec3_field(neighbours(triangles))
        self.low = ti.Vector.field(3, float, shape=self.patch_count)
        self.high = ti.Vector.field(3, float, shape=self.patch_count)
        self.hem = ti.field(ti.i32, shape=self.patch_count)
        self.hem.from_numpy(_near_hem(sheet, reach).astype(np.int32))
        around, start = triangles_of_nodes(triangles, node_count)
        self.around = ti.field(ti.i32, shape=len(around))
        self.around.from_numpy(around)
        self.around_start = ti.field(ti.i32, shape=node_count + 1)
        self.around_start.from_numpy(start)

    @ti.kernel
    def begin(self, reach: float):
        """Remember where the sheet stands, its node normals, and patch boxes grown by `reach` [m]."""
        ti.loop_config(serialize=self.few)
        for n in self.x:
            self.x0[n] = self.x[n]
            normal = tm.vec3(0.0)
            for s in range(self.around_start[n], self.around_start[n + 1]):
                a, b, c = self.points(self.around[s])
                normal += (b - a).cross(c - a)
            self.normal[n] = normal.normalized(1e-30)
        ti.loop_config(serialize=self.few)
        for p in range(self.patch_count):
            low, high = self.box(p, self.x)
            self.low[p] = low - reach
            self.high[p] = high + reach

    @ti.kernel
    def bound_sweep(self, reach: float):
        """Boxes of each patch on its way from x0 to x, grown by `reach` [m]."""
        ti.loop_config(serialize=self.few)
        for p in range(self.patch_count):
            low0, high0 = self.box(p, self.x0)
            low1, high1 = self.box(p, self.x)
            self.low[p] = ti.min(low0, low1) - reach
            self.high[p] = ti.max(high0, high1) + reach

    @ti.func
    def box(self, p, x: ti.template()):
        t, u = self.corner[2 * p], self.corner[2 * p + 1]
        low, high = x[t[0]], x[t[0]]
        for k in ti.static(range(3)):
            low = ti.min(low, x[t[k]], x[u[k]])
            high = ti.max(high, x[t[k]], x[u[k]])
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
    def face_normal(self, t):
        a, b, c = self.points(t)
        return (b - a).cross(c - a).normalized(1e-30)


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


def _ivec3_field(values: np.ndarray):
    field = ti.Vector.field(3, ti.i32, shape=len(values))
    field.from_numpy(values.astype(np.int32))
    return field
