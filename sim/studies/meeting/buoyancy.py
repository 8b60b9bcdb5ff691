"""A sheet laid on water: the light one floats at its draught, the heavy one lies on the floor."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row

HEAVY = ("cloth.fabric.area_density=11 kg/m^2", "cloth.fabric.porosity=0.05", "cloth.fabric.bending=1e-3 N m")


def measure(world: Any) -> dict[str, float]:
    """Figures of the run's end.

    error   how far the sheet's middle height is from where it must be, in spacings: at the water's level less the
            draught rho_A/rho where it is lighter than water, on the floor where it is heavier
    leaks   crossings
    """
    while world.frame_index < world.frame_count:
        world.advance()
    rest, fabric, dx = world.config.fluid.liquid.rest_density, world.config.cloth.fabric, world.config.fluid.spacing
    tank = world.config.solid["tank"]
    surface = row(world, "mass").sum() / (rest * tank.size[0] * tank.size[1])
    floats = fabric.area_density / fabric.thickness < rest
    place = surface - fabric.area_density / rest if floats else 0.5 * fabric.thickness
    height = world.state["cloth.x"].to_numpy()[:, 2].astype(np.float64)
    return {
        "error": (np.median(height) - tank.centre[2] - place) / dx,
        "leaks": world.build.parts["contact"].counts()["leaks"],
        "tilt": (height.max() - height.min()) / dx,
    }


CASE = Case(
    name="buoyancy",
    scene="buoyancy",
    reference="Archimedes: a sheet keeps dry what weighs as much as it",
    bounds={"error": 1.0, "leaks": 0.0},
    measure=measure,
    full=(Point(), Point(HEAVY)),
    quick=(Point(("fluid.spacing=6 mm", "cloth.spacing=1 cm", "run.duration=1 s")),),
)
