"""Water squeezed between two layers of cloth: it leaves by the hems alone."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point


def measure(world: Any) -> dict[str, float]:
    """Figures of the run: leaks; caught, the share of particle-steps in which the last step acted; squeezed, the height
    of the upper layer's middle over that at the start."""
    particle_steps, start = 0, _height(world)
    while world.frame_index < world.frame_count:
        world.step()
        particle_steps += int(world.state.count[None])
    counts = world.build.parts["contact"].counts()
    return {"caught": counts["caught"] / particle_steps, "leaks": counts["leaks"], "squeezed": _height(world) / start}


def _height(world: Any) -> float:
    x = world.state["cloth.x"].to_numpy().reshape(*world.scene.sheet.shape, 3)
    upper = x[3 * x.shape[0] // 4 :, x.shape[1] // 4 : 3 * x.shape[1] // 4, 2]
    return float(np.median(upper))


CASE = Case(
    name="sandwich",
    scene="sandwich",
    reference="nothing passes a layer",
    bounds={"leaks": 0.0, "squeezed": 0.7},
    measure=measure,
    full=(Point(),),
    quick=(Point(("fluid.spacing=4 mm", "cloth.spacing=1 cm", "run.duration=0.4 s")),),
)
