"""A jet on a wall, held against what it brings in momentum."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point

STEADY = 0.5
"""Of the run: from then on the sheet has reached its edge, and the force is taken."""


def measure(world: Any) -> dict[str, float]:
    """error: mean force on the wall over rho Q v, less 1; rebound: v away from the wall far out, over the jet's."""
    from sim.studies.water.gauge import Gauge

    gauge, config = Gauge(world), world.config
    jet = next(iter(config.emitter.values()))
    brought = config.fluid.liquid.rest_density * jet.rate * jet.speed
    taken, begin = 0.0, STEADY * config.run.duration
    while world.clock.time < config.run.duration - 1e-9:
        before = world.clock.time
        world.step()
        dt = world.clock.time - before
        if before >= begin:
            taken -= dt * gauge.read(dt)[1][:, 0].sum()
    x, v = (world.state[f"fluid.{name}"].to_numpy()[: world.state.count[None]] for name in "xv")
    far = np.hypot(x[:, 1], x[:, 2]) > 2.0 * jet.diameter
    return {
        "error": float(taken / (world.clock.time - begin) / brought - 1.0),
        "rebound": float(v[far, 0].mean() / jet.speed),
    }


CASE = Case(
    name="jet",
    scene="jet",
    reference="momentum of the jet, rho Q v",
    bounds={"error": 0.05},
    measure=measure,
    full=(Point(("run.duration=0.3",)),),
    quick=(Point(("run.duration=0.2", "fluid.spacing=0.0024")),),
)
