"""Signed distance to solids. Pure functions: point in, (distance, outward normal) out, as a 4-vector (n, d)."""

import taichi as ti
import taichi.math as tm


@ti.func
def plane_distance(x, point, normal):
    """(normal, (x - point) . normal); the solid is the side the normal leaves."""
    return tm.vec4(normal, (x - point).dot(normal))


@ti.func
def sphere_distance(x, centre, radius):
    """(radial normal, |x - centre| - radius); the normal at the very centre is +z."""
    r = x - centre
    length = r.norm()
    normal = tm.vec3(0.0, 0.0, 1.0)
    if length > 0.0:
        normal = r / length
    return tm.vec4(normal, length - radius)


@ti.func
def box_distance(x, centre, half):
    """Axis-aligned box: exact distance outside and inside; inside, the normal of the nearest face."""
    r = x - centre
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
