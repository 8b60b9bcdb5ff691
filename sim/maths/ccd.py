"""A moving point against a moving triangle: the first time at which it lies in the triangle. f64 inside.

The four points are coplanar when a cubic f(t) vanishes (Provot 1997; Bridson 2002, section 6.1). A root alone may be
lost to rounding: of a point that turns round in the plane, that slides along it, or of a triangle without area. So each
monotone piece gives the times between which |f| is within its rounding error; the root is tried first, then the times
are walked through in steps of gap over largest relative speed, which pass no contact (conservative advancement, Mirtich
1996). What comes nearer than the slack is a hit: nothing is missed, and only misses that near are taken for hits.
"""

import taichi as ti
import taichi.math as tm

EXACT, ROUNDED = 2.0**-50, 2.0**-22
"""[1] Slack, of the largest coordinate: of points that are meant as they stand, and of points rounded to f32 (two of
them may be parted by sqrt(3) 2^-23)."""
ROUNDING = 2.0**-48
"""[1] of the product of the largest edges: error of the cubic in f64, with room."""
BISECTIONS = 50
STRIDES_MAX = 1000
"""Of a walk; a point that slides through the plane beside the triangle, nearer to it than its way / 1000, is a hit."""
POINT, EDGES = 0, 1
"""What meets what among four points: the first against the triangle of the others; the edge of the first two against
that of the last two."""


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
def gap(q, u, v, rounding):
    """(distance of q from the triangle 0, u, v; weights of u and v of the nearest point), f64.

    rounding: error of q . (u x v) [m^3], taken off; the edges count by themselves, for a sliver has no normal.
    """
    n = u.cross(v)
    area_sq = n.dot(n)
    w1, w2 = q.cross(v).dot(n), u.cross(q).dot(n)
    s, r = _along(q, u), _along(q, v)
    near = ti.Vector([(q - s * u).norm(), s, 0.0], ti.f64)
    other = (q - r * v).norm()
    if other < near[0]:
        near = ti.Vector([other, 0.0, r], ti.f64)
    s = _along(q - u, v - u)
    other = (q - u - s * (v - u)).norm()
    if other < near[0]:
        near = ti.Vector([other, 1.0 - s, s], ti.f64)
    if area_sq > 0.0 and w1 >= 0.0 and w2 >= 0.0 and w1 + w2 <= area_sq:
        other = ti.max(ti.abs(q.dot(n)) - rounding, 0.0) / ti.sqrt(area_sq)
        if other < near[0]:
            near = ti.Vector([other, w1 / area_sq, w2 / area_sq], ti.f64)
    return near


@ti.func
def _along(q, e):
    """Where the segment 0-e is nearest to q, 0 to 1."""
    s = ti.cast(0.0, ti.f64)
    ee = e.dot(e)
    if ee > 0.0:
        s = tm.clamp(q.dot(e) / ee, 0.0, 1.0)
    return s


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
def _bisect(c, a, b):
    """Where a cubic that changes sign between a and b does so."""
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
def _times(c, a, b, eps):
    """(first, root, last): when a monotone piece a-b reaches -eps, 0 and eps, or the reverse; a or b if beyond."""
    upward = 1.0 if cubic(c, a) <= cubic(c, b) else -1.0
    times = ti.Vector([a, a, a], ti.f64)
    for j in range(3):
        shifted = c
        shifted[0] -= upward * eps * ti.cast(j - 1, ti.f64)
        if upward * cubic(shifted, a) < 0.0:
            times[j] = _bisect(shifted, a, b)
    return times


@ti.func
def _apart(x, y):
    """x - y in f64, exact for f32 coordinates of like size."""
    return ti.cast(x, ti.f64) - ti.cast(y, ti.f64)


@ti.func
def _largest(x):
    return ti.cast(ti.abs(x).max(), ti.f64)


@ti.func
def first_hit(x0, x1, a0, a1, b0, b1, c0, c1, slack):
    """(t, b1, b2) of the first contact in [0, 1]; t = 2 where there is none. Points move linearly, 0 -> 1 [m].

    slack: EXACT or ROUNDED. b1, b2: weights of b and c in the point of the triangle that is met.
    """
    q0, u0, v0 = _apart(x0, a0), _apart(b0, a0), _apart(c0, a0)
    q1, u1, v1 = _apart(x1, a1), _apart(b1, a1), _apart(c1, a1)
    reach = ti.max(
        _largest(x0), _largest(x1), _largest(a0), _largest(a1), _largest(b0), _largest(b1), _largest(c0), _largest(c1)
    )
    return _met(POINT, q0, q1, u0, u1, v0, v1, slack * ti.max(reach, 1e-30))


@ti.func
def _met(kind, q0, q1, u0, u1, v0, v1, tol):
    """(t, b1, b2) of the first time at which q is within tol of the triangle 0, u, v; EDGES: the parallelogram."""
    dq, du, dv = q1 - q0, u1 - u0, v1 - v0
    c = coplanar_cubic(q0, dq, u0, du, v0, dv)
    middle = 0.5 * (u0.cross(v1) + u1.cross(v0))  # of the area's Bernstein hull
    area = ti.sqrt(ti.max(u0.cross(v0).norm_sqr(), middle.norm_sqr(), u1.cross(v1).norm_sqr()))
    u_sq, v_sq = ti.max(u0.norm_sqr(), u1.norm_sqr()), ti.max(v0.norm_sqr(), v1.norm_sqr())
    rounding = ROUNDING * ti.sqrt(ti.max(q0.norm_sqr(), q1.norm_sqr()) * u_sq * v_sq)
    eps = tol * area + rounding
    hull = ti.Vector([c[0], c[0] + c[1] / 3.0, c[0] + (2.0 * c[1] + c[2]) / 3.0, c.sum()], ti.f64)
    hit = ti.Vector([2.0, 0.0, 0.0], ti.f64)
    if hull.min() <= eps and hull.max() >= -eps:  # else the Bernstein hull has no root: most queries end here
        hit = _search(kind, c, q0, dq, u0, du, v0, dv, tol, eps, rounding)
    return hit


@ti.func
def _search(kind, c, q0, dq, u0, du, v0, dv, tol, eps, rounding):
    """Piece by piece between the knots where the derivative vanishes: the root, then the walk."""
    hit = ti.Vector([2.0, 0.0, 0.0], ti.f64)
    fastest = ti.max(dq.norm_sqr(), (dq - du).norm_sqr(), (dq - dv).norm_sqr(), 1e-300)
    if kind == EDGES:
        fastest = ti.max(fastest, (dq - du - dv).norm_sqr())
    speed = ti.sqrt(fastest)
    knots = _knots(c)
    for k in range(3):
        f_a, f_b = cubic(c, knots[k]), cubic(c, knots[k + 1])
        if hit[0] > 1.0 and ti.min(f_a, f_b) <= eps and ti.max(f_a, f_b) >= -eps:
            times = _times(c, knots[k], knots[k + 1], eps)
            at_root = f_a * f_b <= 0.0
            t = times[1] if at_root else times[0]
            strides = 0
            while hit[0] > 1.0 and (at_root or t <= times[2]):
                near = _nearest(kind, q0 + t * dq, u0 + t * du, v0 + t * dv, rounding)
                if near[0] <= tol or strides == STRIDES_MAX:
                    hit = ti.Vector([t, near[1], near[2]], ti.f64)
                t = times[0] if at_root else t + ti.max(near[0] / speed, 1e-16)
                at_root = False
                strides += 1
    return hit


@ti.func
def _nearest(kind, q, u, v, rounding):
    """`gap`; of EDGES to the nearer half of the parallelogram, with the half's own weights."""
    near = ti.Vector([1e300, 0.0, 0.0], ti.f64)
    for half in range(1 + kind):  # gap once in the code, for it is dear to compile
        way = 1.0 - 2.0 * ti.cast(half, ti.f64)
        other = gap(q - ti.cast(half, ti.f64) * (u + v), way * u, way * v, rounding)
        if other[0] < near[0]:
            near = other
    return near


@ti.func
def spanned(kind, a, b, c, d):
    """(q, u, v) whose triple product q . (u x v) vanishes where the four points are coplanar."""
    q, u, v = a - b, c - b, d - b
    if kind == EDGES:
        q, u, v = c - a, b - a, d - c
    return q, u, v


@ti.func
def shares(kind, q, u, v):
    """(share of the second point or of u's end, the other, whether both lie in the triangle or on the edges).

    Point: barycentric weights b1, b2 of the projection. Edges: the places s, t where the lines come nearest.
    """
    uu, uv, vv = u.dot(u), u.dot(v), v.dot(v)
    det = uu * vv - uv * uv
    found = det > 1e-12 * uu * vv
    qu, qv = q.dot(u), q.dot(v)
    one, two = (vv * qu - uv * qv) / det, (uu * qv - uv * qu) / det
    if kind == EDGES:
        two = -two
    return one, two, found


@ti.func
def within(kind, one, two, slack):
    """Whether shares lie in the triangle, or on both edges, to `slack` [1]."""
    room = 1.0 - one - two
    if kind == EDGES:
        room = 1.0 - ti.max(one, two)
    return ti.min(one, two, room) >= -slack


@ti.func
def meets(kind, a0, b0, c0, d0, a1, b1, c1, d1):
    """Whether a point and a triangle, or two edges, touch at any moment of the linear way 0 -> 1 [m]. All in f64.

    Two edges touch where the gap q of their first ends lies in the parallelogram of u and -v: so both kinds are one.
    """
    q0, u0, v0 = spanned(kind, a0, b0, c0, d0)
    q1, u1, v1 = spanned(kind, a1, b1, c1, d1)
    if kind == EDGES:
        v0, v1 = -v0, -v1
    reach = ti.max(_largest(a0), _largest(b0), _largest(c0), _largest(d0))
    reach = ti.max(reach, _largest(a1), _largest(b1), _largest(c1), _largest(d1))
    return _met(kind, q0, q1, u0, u1, v0, v1, EXACT * ti.max(reach, 1e-30))[0] <= 1.0
