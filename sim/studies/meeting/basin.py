"""Water poured on a sheet that lines a basin: all of it stays over the sheet, level, and as high as it must."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.meeting.load import depth_by_mass, level, under
from sim.studies.probe import row


def measure(world: Any) -> dict[str, float]:
    """Figures of the run, but for leaks and lost at its end.

    error   height of the water's surface, mean over nodes under two spacings or more of it, over that to which its
            volume fills the sheet [spacings]
    uneven  rms of that surface about its mean [spacings]
    lost    share of the water poured that is not over the sheet: beside it, below it, or gone; drops of the first
            splash may leap the hems
    caught  share of particle-steps in which the last step acted
    leaks   crossings
    """
    particle_steps = 0
    while world.frame_index < world.frame_count:
        world.step()
        particle_steps += int(world.state.count[None])
    counts, triangles = world.build.parts["contact"].counts(), world.scene.sheet.triangles
    x = world.state["cloth.x"].to_numpy().astype(np.float64)
    rest, dx = world.config.fluid.liquid.rest_density, world.config.fluid.spacing
    water, mass = row(world, "x"), row(world, "mass")
    corners, shares = under(x, triangles, water)
    over = (corners[:, 0] >= 0) & (water[:, 2] > (x[corners, 2] * shares).sum(1))
    depth = depth_by_mass(x, triangles, water[over], mass[over], rest)
    surface = (x[:, 2] + depth)[depth >= 2.0 * dx]
    return {
        "error": (surface.mean() - level(x, triangles, mass[over].sum() / rest)) / dx,
        "uneven": surface.std() / dx,
        "lost": 1.0 - mass[over].sum() / world.ledger_row()["emitted"],
        "caught": counts["caught"] / particle_steps,
        "leaks": counts["leaks"],
    }


CASE = Case(
    name="basin",
    scene="basin",
    reference="water keeps its volume and finds its level",
    bounds={"error": 0.5, "uneven": 0.5, "lost": 5e-4, "caught": 1e-4, "leaks": 0.0},
    measure=measure,
    full=(Point(("run.duration=3 s",)),),
    quick=(
        Point(
            ("fluid.spacing=5 mm", "cloth.spacing=12 mm", "cloth.settle=1 s", "run.duration=1.6 s",
             "emitter.spout.rate=250 ml/s", "emitter.spout.start=0 s", "emitter.spout.stop=0.7 s"),
        ),
    ),
)  # fmt: skip
