"""Signed distance to solids. Pure functions of a point r in the solid's own axes: (outward normal, distance [m])."""

import taichi as ti
import taichi.math as tm


@ti.func
def sphere_distance(r, radius):
    """(radial normal, |r| - radius); the normal at the very centre is +z."""
    length = r.norm()
    normal = tm.vec3(0.0, 0.0, 1.0)
    if length > 0.0:
        normal = r / length
    return tm.vec4(normal, length - radius)


@ti.func
def box_distance(r, half):
    """Box about the origin: exact distance outside and inside; inside, the normal of the nearest face."""
    q = ti.abs(r) - half
    outside = ti.max(q, 0.0)
    length = outside.norm()
    normal = tm.vec3(0.0, 0.0, 0.0)
    distance = length
    if length > 0.0:
        normal = outside * ti.math.sign(r) / length
    else:
        axis = 0
        if q[1] > q[0]:
            axis = 1
        if q[2] > ti.max(q[0], q[1]):
            axis = 2
        distance = ti.max(q[0], q[1], q[2])
        for k in ti.static(range(3)):
            if k == axis:
                normal[k] = 1.0 if r[k] >= 0.0 else -1.0
    return tm.vec4(normal, distance)


@ti.func
def cylinder_distance(r, radius, half):
    """Upright about the origin, from z = -half to half: exact outside and inside, as of a box in (radius, z)."""
    across = ti.Vector([r[0], r[1], 0.0])
    reach = across.norm()
    outward = tm.vec3(1.0, 0.0, 0.0)
    if reach > 0.0:
        outward = across / reach
    upward = tm.vec3(0.0, 0.0, 1.0 if r[2] >= 0.0 else -1.0)
    side, end = reach - radius, ti.abs(r[2]) - half
    normal, distance = outward, side
    if end > side:
        normal, distance = upward, end
    if side > 0.0 and end > 0.0:
        distance = ti.sqrt(side * side + end * end)
        normal = (side * outward + end * upward) / distance
    return tm.vec4(normal, distance)


@ti.func
def grid_distance(samples: ti.template(), first, shape, cell, p):
    """(gradient made unit, distance) of samples [m] interpolated trilinearly; shape (ni, nj, nk), k fastest.

    p: from the first sample. Outside of the samples: of the nearest of them, plus the way there.
    """
    most = ti.cast(shape - 1, float)
    at = tm.clamp(p / cell, 0.0, most - 1e-3)
    away = p - at * cell
    n = ti.cast(at, ti.i32)
    f = at - n
    base = first + (n[0] * shape[1] + n[1]) * shape[2] + n[2]
    slope, distance = tm.vec3(0.0), 0.0
    for i, j, k in ti.static(ti.ndrange(2, 2, 2)):
        d = samples[base + (i * shape[1] + j) * shape[2] + k]
        wx, wy, wz = (f[0] if i else 1.0 - f[0]), (f[1] if j else 1.0 - f[1]), (f[2] if k else 1.0 - f[2])
        distance += wx * wy * wz * d
        slope += d * tm.vec3(
            (1.0 if i else -1.0) * wy * wz, (1.0 if j else -1.0) * wx * wz, (1.0 if k else -1.0) * wx * wy
        )
    far = away.norm()
    normal = slope
    if far > 1e-2 * cell:
        normal, distance = away, distance + far
    length = normal.norm()
    if length > 1e-6:
        normal /= length
    else:
        normal = tm.vec3(0.0, 0.0, 1.0)
    return tm.vec4(normal, distance)
