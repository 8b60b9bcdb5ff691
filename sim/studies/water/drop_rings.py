"""A drop rings: the period of its second mode."""

import math

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row


def measure(world) -> dict[str, float]:
    """Period from the first to the third time that the drop is round, of a drop let go at its longest.

    error    period over 2 pi sqrt(rho R^3/(8 gamma)) (Rayleigh 1879, n = 2), less 1
    period   [s]
    kept     of the stretch, one period on
    volume   of the ellipsoid with the drop's second moments, at the end, over the ball's, less 1
    """
    liquid, ball = world.config.fluid.liquid, world.config.fluid.ball["drop"]
    expected = 2.0 * math.pi * math.sqrt(liquid.rest_density * ball.radius**3 / (8.0 * liquid.surface_tension))
    times, axes = [], []
    while world.clock.time < 1.5 * expected:
        world.step()
        times.append(world.clock.time)
        axes.append(np.sqrt(5.0 * row(world, "x").var(0)))
    stretch = [c - 0.5 * (a + b) for a, b, c in axes]
    period = _period(np.array(times), np.array(stretch))
    return {
        "error": period / expected - 1.0,
        "period": period,
        "kept": np.interp(period, times, stretch) / (ball.half_axes[2] - ball.half_axes[0]),
        "volume": np.prod(axes[-1]) / np.prod(ball.half_axes) - 1.0,
    }


def _period(times: np.ndarray, stretch: np.ndarray) -> float:
    """From the first to the third zero [s]; nan where there are fewer."""
    change = np.flatnonzero(np.sign(stretch[:-1]) != np.sign(stretch[1:]))
    zeros = times[change] + np.diff(times)[change] * stretch[change] / (stretch[change] - stretch[change + 1])
    return float(zeros[2] - zeros[0]) if len(zeros) > 2 else math.nan


CASE = Case(
    name="drop_rings",
    scene="drop_rings",
    reference="Rayleigh 1879: 2 pi sqrt(rho R^3/(8 gamma)) = 23.3 ms",
    bounds={"error": 0.15},
    measure=measure,
    full=(Point(), Point(("fluid.support=2.5",))),
    quick=(Point(("fluid.spacing=0.25 mm",)),),
)
