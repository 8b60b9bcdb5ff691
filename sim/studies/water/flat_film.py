"""A flat film: the surface tension of water that is no drop."""

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row
from sim.studies.water.stress import Stress, stir

SETTLED = 0.5
"""[1] of the run: stress is a mean over what is left."""


def measure(world) -> dict[str, float]:
    """gamma [N/m], half of int (p_across - p_along) dz: of each face. error: over the liquid's, less 1."""
    config = world.config
    stir(world)
    low, high = np.array(config.space.low), np.array(config.space.high)
    stress, seen = Stress(world), []
    while world.clock.time < config.run.duration - 1e-9:
        world.step()
        if world.clock.time > SETTLED * config.run.duration:
            along_x, along_y, across = stress.read().sum(0)
            seen.append(across - 0.5 * (along_x + along_y))
    gamma = 0.5 * np.mean(seen) * row(world, "mass")[0] / config.fluid.liquid.rest_density / np.prod((high - low)[:2])
    return {"error": gamma / config.fluid.liquid.surface_tension - 1.0, "gamma": gamma}


CASE = Case(
    name="flat_film",
    scene="flat_film",
    reference="Kirkwood & Buff 1949: the liquid's gamma",
    bounds={"error": 0.1},
    measure=measure,
    full=(Point(), Point(("fluid.support=2.5",))),
    quick=(),
)
