"""A moving point against a moving triangle: the first time at which it lies in the triangle. f64 inside.

The four points are coplanar when a cubic in t vanishes (Provot 1997; Bridson 2002, section 6.1). Its monotone
pieces are found from the derivative and each is bisected, so no root is lost to a bad start of Newton's method.
"""

import taichi as ti
import taichi.math as tm

dvec3 = ti.types.vector(3, ti.f64)

BISECTIONS = 50
INSIDE = 1e-7
"""[1] barycentric slack, so that a point on the edge of two triangles is not lost between them."""


@ti.func
def cubic(c, t):
    """c[0] + c[1] t + c[2] t^2 + c[3] t^3."""
    return c[0] + t * (c[1] + t * (c[2] + t * c[3]))


@ti.func
def coplanar_cubic(q0, dq, u0, du, v0, dv):
    """Coefficients of (q0 + t dq) . ((u0 + t du) x (v0 + t dv))."""
    a = u0.cross(v0)
    b = du.cross(v0) + u0.cross(dv)
    d = du.cross(dv)
    return ti.Vector([q0.dot(a), dq.dot(a) + q0.dot(b), dq.dot(b) + q0.dot(d), dq.dot(d)], ti.f64)


@ti.func
def barycentric(q, u, v):
    """(b1, b2) of the projection of q on the plane of u and v; (-1, -1) for a triangle without area."""
    uu, uv, vv = u.dot(u), u.dot(v), v.dot(v)
    det = uu * vv - uv * uv
    b = ti.Vector([-1.0, -1.0], ti.f64)
    if det > 1e-14 * uu * vv:
        qu, qv = q.dot(u), q.dot(v)
        b = ti.Vector([(vv * qu - uv * qv) / det, (uu * qv - uv * qu) / det], ti.f64)
    return b


@ti.func
def _bisect(c, a, b):
    lo, hi = a, b
    f_lo = cubic(c, lo)
    for _ in range(BISECTIONS):
        mid = 0.5 * (lo + hi)
        f = cubic(c, mid)
        if (f > 0.0) == (f_lo > 0.0):
            lo = mid
        else:
            hi = mid
    return 0.5 * (lo + hi)


@ti.func
def _knots(c):
    """0, the extrema of the cubic within [0, 1], 1; in order."""
    knots = ti.Vector([0.0, 1.0, 1.0, 1.0], ti.f64)
    p, q, r = 3.0 * c[3], 2.0 * c[2], c[1]
    disc = q * q - 4.0 * p * r
    if disc > 0.0:
        s = -0.5 * (q + (ti.sqrt(disc) if q >= 0.0 else -ti.sqrt(disc)))
        t1 = ti.cast(2.0, ti.f64)
        t2 = ti.cast(2.0, ti.f64)
        if ti.abs(p) > 1e-30 * ti.abs(s):
            t1 = s / p
        if s != 0.0:
            t2 = r / s
        knots[1] = tm.clamp(ti.min(t1, t2), 0.0, 1.0)
        knots[2] = tm.clamp(ti.max(t1, t2), 0.0, 1.0)
    return knots


@ti.func
def _apart(x, y):
    """x - y in f64, exact for f32 coordinates of like size."""
    return ti.cast(x, ti.f64) - ti.cast(y, ti.f64)


@ti.func
def first_hit(x0, x1, a0, a1, b0, b1, c0, c1):
    """(t, b1, b2) of the first crossing in [0, 1]; t = 2 where there is none. Points move linearly, 0 -> 1 [m]."""
    q0, u0, v0 = _apart(x0, a0), _apart(b0, a0), _apart(c0, a0)
    q1, u1, v1 = _apart(x1, a1), _apart(b1, a1), _apart(c1, a1)
    dq, du, dv = q1 - q0, u1 - u0, v1 - v0
    c = coplanar_cubic(q0, dq, u0, du, v0, dv)
    hit = ti.Vector([2.0, 0.0, 0.0], ti.f64)
    hull = ti.Vector([c[0], c[0] + c[1] / 3.0, c[0] + (2.0 * c[1] + c[2]) / 3.0, c.sum()], ti.f64)
    if hull.min() <= 0.0 <= hull.max():  # else the Bernstein hull has no root: most queries end here
        hit = _search(c, q0, dq, u0, du, v0, dv)
    return hit


@ti.func
def _search(c, q0, dq, u0, du, v0, dv):
    """Roots piece by piece between the knots where the derivative vanishes, the first that lies in the triangle."""
    hit = ti.Vector([2.0, 0.0, 0.0], ti.f64)
    knots = _knots(c)
    for k in range(3):
        if hit[0] > 1.0:
            f_a, f_b = cubic(c, knots[k]), cubic(c, knots[k + 1])
            if f_a * f_b <= 0.0 and (f_a != 0.0 or f_b != 0.0):
                t = _bisect(c, knots[k], knots[k + 1])
                if f_a == 0.0:
                    t = knots[k]
                elif f_b == 0.0:
                    t = knots[k + 1]
                b = barycentric(q0 + t * dq, u0 + t * du, v0 + t * dv)
                if b[0] >= -INSIDE and b[1] >= -INSIDE and b[0] + b[1] <= 1.0 + INSIDE:
                    hit = ti.Vector([t, b[0], b[1]], ti.f64)
    return hit
