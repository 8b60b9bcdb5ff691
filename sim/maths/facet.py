"""A point and one triangle: the nearest point, and the gap over its plane. Pure functions."""

import taichi as ti
import taichi.math as tm


@ti.func
def closest_barycentric(x, a, b, c):
    """Weights (of a, b, c) of the point of the triangle nearest to x; exact zeros on edges and corners.

    Ericson 2005, section 5.1.5; a triangle without area gives a corner or a point of an edge.
    """
    ab, ac, ap = b - a, c - a, x - a
    d1, d2 = ab.dot(ap), ac.dot(ap)
    bp, cp = x - b, x - c
    d3, d4 = ab.dot(bp), ac.dot(bp)
    d5, d6 = ab.dot(cp), ac.dot(cp)
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    w = tm.vec3(0.0)
    if d1 <= 0.0 and d2 <= 0.0:
        w = tm.vec3(1.0, 0.0, 0.0)
    elif d3 >= 0.0 and d4 <= d3:
        w = tm.vec3(0.0, 1.0, 0.0)
    elif d6 >= 0.0 and d5 <= d6:
        w = tm.vec3(0.0, 0.0, 1.0)
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3)
        w = tm.vec3(1.0 - s, s, 0.0)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s = d2 / (d2 - d6)
        w = tm.vec3(1.0 - s, 0.0, s)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        s = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        w = tm.vec3(0.0, 1.0 - s, s)
    else:
        s = 1.0 / (va + vb + vc)
        w = tm.vec3(va * s, vb * s, vc * s)
    return w


@ti.func
def plane_gap(x, a, b, c):
    """(unit normal n, n . (x - a), weights of the projection of x on the plane, unclamped)."""
    u, v, q = b - a, c - a, x - a
    n = u.cross(v)
    inverse = 1.0 / ti.max(n.norm_sqr(), 1e-30)
    w1, w2 = inverse * q.cross(v).dot(n), inverse * u.cross(q).dot(n)
    n *= ti.sqrt(inverse)
    return n, q.dot(n), ti.Vector([1.0 - w1 - w2, w1, w2])


@ti.func
def plane_crossing(x0, x1, a0, a1, b0, b1, c0, c1, slack):
    """(t, b1, b2) as sim.maths.ccd.first_hit, the 2019 report's way: t = 2 unless x0 and x1 are on two sides of the
    plane of the triangle as it stands at the end.

    Where on the plane, how the triangle moved, and any slack play no part: it misses, and it sees ghosts.
    """
    _, before, _w = plane_gap(x0, a1, b1, c1)
    _, after, w = plane_gap(x1, a1, b1, c1)
    hit = ti.Vector([2.0, 0.0, 0.0], ti.f64)
    if (before < 0.0) != (after < 0.0):
        hit = ti.Vector([before / (before - after), w[1], w[2]], ti.f64)
    return hit
