"""Triangles into z-buffers by homogeneous edge functions (Olano & Greer 1997): no clipping, four samples a pixel.

A buffer holds int64 keys, depth bits above and triangle id below, so integer atomics make it independent of order.
"""

import numpy as np
import taichi as ti

from render.camera import VEC3, VIEW, project, row

FAR = 3.0e38
EMPTY = int(np.float32(FAR).view(np.int32)) << 32 | 0x7FFFFFFF
NEAR = 1e-3  # [m]
LEAST_FACING = 0.1  # a triangle seen more edge-on yields no farther than ten times
KEYS = ti.types.ndarray(dtype=ti.i64, ndim=3)
POINTS = ti.types.ndarray(dtype=VEC3, ndim=1)
TRIANGLES = ti.types.ndarray(dtype=ti.types.vector(3, ti.i32), ndim=1)


@ti.func
def pack(depth, index):
    """Key of a fragment: positive floats order as their bits do."""
    return (ti.cast(ti.bit_cast(ti.cast(depth, ti.f32), ti.i32), ti.i64) << 32) | ti.cast(index, ti.i64)


@ti.func
def depth_of(key):
    """Depth [m] in a key; FAR when empty."""
    return ti.bit_cast(ti.cast(key >> 32, ti.i32), ti.f32)


@ti.func
def index_of(key):
    """Triangle id in a key."""
    return ti.cast(key & 0x7FFFFFFF, ti.i32)


@ti.func
def sample_offset(s, count):
    """Offset of sample s from the pixel's corner: a rotated grid of 4, or the centre."""
    u, v = 0.5, 0.5
    if count == 4:
        u = 0.125 + 0.25 * ti.cast((2 * s + 1) % 5, ti.f32)
        v = 0.125 + 0.25 * ti.cast(s, ti.f32)
    return ti.Vector([u, v])


@ti.func
def edges(a, b, c):
    """Rows e_i with e_i.d the barycentric weight over depth along ray d, of the triangle with corners a, b, c - eye."""
    ea, eb, ec = b.cross(c - b), c.cross(a - c), a.cross(b - a)
    det = a.dot(ea)
    inverse = 1.0 / det if ti.abs(det) > 1e-20 else 0.0
    return ti.Matrix.rows([ea * inverse, eb * inverse, ec * inverse])


@ti.kernel
def clear(keys: KEYS, value: ti.i64):
    """Fill a buffer."""
    for y, x in ti.ndrange(keys.shape[0], keys.shape[1]):
        for s in range(keys.shape[2]):
            keys[y, x, s] = value


@ti.func
def bounds(a, b, c, view, lens, width, height):
    """Pixel box (x0, y0, x1, y1) of a triangle; the whole image when it reaches behind the eye."""
    box = ti.Vector([0, 0, width, height])
    pa, pb, pc = project(view, lens, a), project(view, lens, b), project(view, lens, c)
    if ti.min(pa[2], pb[2], pc[2]) > NEAR:
        low, high = ti.min(pa, pb, pc), ti.max(pa, pb, pc)
        box[0] = ti.cast(ti.math.clamp(ti.floor(low[0]), 0.0, width), ti.i32)
        box[1] = ti.cast(ti.math.clamp(ti.floor(low[1]), 0.0, height), ti.i32)
        box[2] = ti.cast(ti.math.clamp(ti.floor(high[0]) + 1.0, 0.0, width), ti.i32)
        box[3] = ti.cast(ti.math.clamp(ti.floor(high[1]) + 1.0, 0.0, height), ti.i32)
    return box


def strips(triangles: np.ndarray) -> int:
    """Bands to cut an image into, so that a few big triangles keep all threads busy."""
    return 1 if len(triangles) > 500 else 45


@ti.func
def row_span(base, along, down, x0, x1):
    """Pixels of a row, within [x0, x1), that any sample of which may lie inside all three edges."""
    low, high = ti.cast(x0, ti.f32), ti.cast(x1, ti.f32)
    for i in ti.static(range(3)):
        room = base[i] + 0.5 * (ti.abs(along[i]) + ti.abs(down[i]))
        if ti.abs(along[i]) > 1e-12:
            crossing = -room / along[i] - 0.5
            if along[i] > 0.0:
                low = ti.max(low, ti.min(crossing, high))
            else:
                high = ti.min(high, ti.max(crossing + 1.0, low))
    return ti.Vector([ti.cast(ti.floor(low), ti.i32), ti.cast(ti.ceil(high), ti.i32)])


@ti.func
def _along_normal(sight, u, v, forward):
    """How far the line of sight that is 1 m deep goes along the unit normal of the triangle of edges u, v."""
    return sight.dot(u.cross(v).normalized(1e-20)) / ti.max(sight.dot(forward), NEAR)


@ti.func
def _hides(key, first_id, depth):
    """Whether what is there has an id before first_id and is no deeper than depth."""
    return index_of(key) < first_id and depth_of(key) <= depth


@ti.kernel
def rasterise(
    x: POINTS,
    triangles: TRIANGLES,
    first_id: ti.i32,
    view: VIEW,
    lens: VEC3,
    strips: ti.i32,
    nearest: KEYS,
    farthest: KEYS,
    walls: ti.i32,
    yields: ti.f32,
):
    """Nearest fragment of each sample; with `walls` 1 of front faces only, and the farthest of them as well, with 2 of
    back faces only.

    `strips` cuts every triangle into bands of rows, so that a few big ones keep all threads busy. A fragment yields to
    what is there with an id before `first_id` if that lies no more than `yields` [m] behind its triangle's plane.
    """
    height, width, count = nearest.shape[0], nearest.shape[1], nearest.shape[2]
    for t, strip in ti.ndrange(triangles.shape[0], strips):
        corner = triangles[t]
        a, b, c = x[corner[0]], x[corner[1]], x[corner[2]]
        box = bounds(a, b, c, view, lens, width, height)
        eye = row(view, 3)
        front = (b - a).cross(c - a).dot(eye - a) > 0
        shown = walls == 0 or (front if walls == 1 else not front)
        if shown:
            e = edges(a - eye, b - eye, c - eye)
            along = e @ row(view, 0) / lens[0]
            down = -(e @ row(view, 1)) / lens[0]
            base = e @ row(view, 2) - lens[1] * along - lens[2] * down
            slack = -1e-4 / ti.max((a - eye).norm(), NEAR)
            behind = yields / ti.max(ti.abs(_along_normal(a - eye, b - a, c - a, row(view, 2))), LEAST_FACING)
            for py in range(ti.max(box[1], height * strip // strips), ti.min(box[3], height * (strip + 1) // strips)):
                span = row_span(base + (py + 0.5) * down, along, down, box[0], box[2])
                for px in range(span[0], span[1]):
                    for s in range(count):
                        at = sample_offset(s, count)
                        w = base + (px + at[0]) * along + (py + at[1]) * down
                        if ti.min(w[0], w[1], w[2]) >= slack:
                            depth = 1.0 / ti.max(w.sum(), 1e-30)
                            if NEAR < depth < 1e30:
                                key = pack(depth, first_id + t)
                                if yields == 0.0 or not _hides(nearest[py, px, s], first_id, depth + behind):
                                    ti.atomic_min(nearest[py, px, s], key)
                                if walls == 1:
                                    ti.atomic_max(farthest[py, px, s], key)
