"""The ground: a checkered plane that fades into the sky, each pixel an exact mean over its footprint."""

import taichi as ti

PALE = (0.76, 0.75, 0.735)
DARK = (0.38, 0.39, 0.405)


@ti.func
def _ramp(x):
    """Integral of the square wave of period 2 (+1 on [0, 1), -1 on [1, 2)): a triangle wave."""
    return ti.abs(x - 2.0 * ti.floor(0.5 * x) - 1.0)


@ti.func
def _wave(x, width):
    """Mean of the square wave over [x - width/2, x + width/2]."""
    return (_ramp(x - 0.5 * width) - _ramp(x + 0.5 * width)) / width


@ti.func
def ground_albedo(at, width, tile):
    """Checks of side `tile` [m] at the plane point `at`, averaged over a box of `width` (2-vector) [m]."""
    w = ti.max(width / tile, 1e-3)
    q = at / tile
    mix = 0.5 + 0.5 * _wave(q[0], w[0]) * _wave(q[1], w[1])
    return ti.Vector(DARK) + (ti.Vector(PALE) - ti.Vector(DARK)) * mix
