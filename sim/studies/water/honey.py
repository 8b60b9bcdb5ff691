"""Honey runs out on a plate: how far its front has come."""

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row

SETTLED = 0.5
"""[s] The front is read from here on: before, the stream's foot is as wide as what it has spread to."""
SLOWLY = ("emitter.spoon.rate=12 ml/s", "emitter.spoon.speed=0.15 m/s", "emitter.spoon.centre=[0.0, 0.0, 0.06]")
"""Huppert's current is driven by its weight alone: the scene's faster jet would drive it too."""


def measure(world) -> dict[str, float]:
    """Largest |R/R_N - 1| at any frame after SETTLED, R_N = 0.715 (g Q^3/(3 nu))^(1/8) t^(1/2) (Huppert 1982).

    error   it; t from when the thread reaches the plate, R = sqrt(2 <r^2>) of the lowest layer, a disc
    reached R at the end [m]
    speed   the fastest particle's of all frames [m/s]
    lowest  the deepest place of all frames over the plate, over the spacing: not below 0 if nothing leaks
    """
    config, fluid, spoon = world.config, world.config.fluid, world.config.emitter["spoon"]
    g = -config.space.gravity[2]
    pace = 0.715 * (g * spoon.rate**3 / (3.0 * fluid.liquid.nu)) ** 0.125
    arrived, errors, reached, speed, lowest = None, [], 0.0, 0.0, np.inf
    while world.clock.time < config.run.duration - 1e-9:
        world.advance()
        x = row(world, "x")
        speed, lowest = max(speed, np.linalg.norm(row(world, "v"), axis=1).max()), min(lowest, x[:, 2].min())
        foot = x[x[:, 2] < 1.2 * fluid.spacing]
        if not len(foot):
            continue
        arrived = world.clock.time if arrived is None else arrived
        reached = np.sqrt(2.0 * (foot[:, :2] ** 2).sum(1).mean())
        if world.clock.time > SETTLED:
            errors.append(abs(reached / (pace * np.sqrt(world.clock.time - arrived)) - 1.0))
    return {"error": max(errors), "reached": reached, "speed": speed, "lowest": lowest / fluid.spacing}


CASE = Case(
    name="honey",
    scene="honey",
    reference="Huppert 1982: 0.715 (g Q^3/(3 nu))^(1/8) t^(1/2)",
    bounds={"error": 0.1},
    measure=measure,
    full=(Point((*SLOWLY, "run.duration=2 s", "run.fps=50")),),
    quick=(),
)
