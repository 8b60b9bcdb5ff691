"""Springs as constraints. Pure functions; every argument may be a number or a vector of lanes."""

import taichi as ti


@ti.func
def spring_scale(length, rest, stiffness, weight):
    """s of the correction x_a += s w_a d, x_b -= s w_b d, with d = x_b - x_a and weight = w_a + w_b.

    XPBD, one iteration (Macklin 2016, eq. 18): s = (1 - rest/length) k/(1 + k weight), k = stiffness h^2 [kg], h the
    substep. In a line of springs under tension T one of two neighbours has been pulled by the other when it is met,
    so that one sweep leaves the line at T (1/k + weight/2) instead of T/k; taking weight/2 out of the denominator
    makes the line exact. It is taken out as far as the correction stays under 1/1.2 of a rigid one: whole for
    k weight <= 1.4, nothing from 5 on. A length of 0 gives no correction, for it has no direction.
    """
    full = stiffness * weight
    resist = 1.0 + ti.min(full, ti.max(0.5 * full, 1.2 * full - 1.0))
    return stiffness * (length - rest) / (ti.max(length, 1e-12) * resist)


@ti.func
def limited_scale(scale, length, longest, stiffness, weight):
    """The larger of `scale` and what brings a spring beyond `longest` back to it at once (Provot 1995).

    No spring of stiffness 0 is limited. Written without a branch, so that lanes stay lanes.
    """
    hard = (length - longest) / (ti.max(length, 1e-12) * ti.max(weight, 1e-12))
    return scale + ti.max(ti.min(hard, 1e30 * stiffness) - ti.max(scale, 0.0), 0.0)
