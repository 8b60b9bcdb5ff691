"""How much room settled water takes: a column falls over in a tank and comes to rest as no lattice."""

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row

WINDOW = 0.5
"""[s] Heights are means over this time, at the end of the run."""


def measure(world) -> dict[str, float]:
    """Means over WINDOW.

    error    room that a particle takes farther than H from walls and surface, over dx^3, less 1: disorder raises a sum
             of kernels, so that water at rest density stands wider apart
    depth    of all the water over what its mass fills, less 1: its surface, where half of the sum is missing, closes up
    speed    rms, at the end [m/s]
    """
    end, fluid, side = world.config.run.duration, world.config.fluid, world.config.solid["tank"].size
    filled = row(world, "mass").sum() / (fluid.liquid.rest_density * side[0] * side[1])
    reach = fluid.support_radius
    low, high = np.array([*(reach - 0.5 * np.array(side[:2])), reach]), 0.5 * np.array([*side[:2], 0.0]) - reach
    high[2] = 0.9 * filled - reach
    inside, heights = [], []
    while world.clock.time < end - 1e-9:
        ended = world.step()
        if world.clock.time > end - WINDOW:
            x = row(world, "x")
            s = np.clip((x - low) / (high - low), 0.0, 1.0)
            inside.append((2.0 * np.sin(np.pi * s) ** 2).prod(1).sum())  # smooth edges: layers come and go unseen
            if ended:
                heights.append(2.0 * x[:, 2].mean())
    return {
        "error": np.prod(high - low) / fluid.spacing**3 / np.mean(inside) - 1.0,
        "depth": np.mean(heights) / filled - 1.0,
        "speed": float(np.sqrt((row(world, "v") ** 2).sum(1).mean())),
    }


def _fallen(support: float) -> Point:
    """The still tank's water, half as wide and twice as high, in a tank that nothing leaves."""
    return Point(
        (
            f"fluid.support={support:g}",
            "fluid.spacing=6.25 mm",
            "run.duration=4 s",
            "fluid.block.water.high=[0.0, 0.05, 0.2]",
            "solid.tank.size=[0.1, 0.1, 0.35]",
            "space.high=[0.07, 0.07, 0.4]",
        )
    )


CASE = Case(
    name="swelling",
    scene="still_tank",
    reference="the volume of its mass at rest density",
    bounds={"error": 0.02},
    measure=measure,
    full=(_fallen(2.0), _fallen(3.0)),
    quick=(),
)
