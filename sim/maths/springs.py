"""Springs as constraints. Pure functions; every argument may be a number or a vector of lanes."""

import taichi as ti


@ti.func
def spring_scale(length, rest, stiffness, weight):
    """s of the correction x_a += s w_a d, x_b -= s w_b d, with d = x_b - x_a and weight = w_a + w_b.

    XPBD, one iteration (Macklin 2016, eq. 18): s = (1 - rest/length) k/(1 + k weight), k = stiffness h^2 [kg], h the
    substep; softened_resistance says why the denominator is a little less. A length of 0 gives no correction, for it
    has no direction.
    """
    return stiffness * (length - rest) / (ti.max(length, 1e-12) * softened_resistance(stiffness * weight))


@ti.func
def softened_resistance(full):
    """The denominator 1 + k weight less what one sweep makes too soft; full = k weight.

    In a line of springs under tension T one of two neighbours has been pulled by the other when it is met, so that
    one sweep leaves the line at T (1/k + weight/2) instead of T/k. Without weight/2 in the denominator the line at
    rest is exact. It is left out as far as a correction stays under 1/1.2 of a rigid one (beyond, sheets with slack
    begin to tremble): whole for k weight <= 1.4, nothing from 5 on.
    """
    return 1.0 + ti.min(full, ti.max(0.5 * full, 1.2 * full - 1.0))


@ti.func
def limited_scale(length, rest, longest, stiffness, weight, elastic):
    """elastic * spring_scale, or what brings a spring beyond `longest` back to it at once if that is more.

    (Provot 1995.) A spring of stiffness 0 is not there. One division and no branch, so that lanes stay lanes.
    """
    some = ti.max(weight, 1e-12)
    resist = softened_resistance(stiffness * weight)
    soft = elastic * stiffness * (length - rest) * some
    hard = ti.min((length - longest) * resist, 1e30 * stiffness)
    return (soft + ti.max(hard - ti.max(soft, 0.0), 0.0)) / (ti.max(length, 1e-12) * resist * some)
