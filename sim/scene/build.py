"""Config -> SceneData: everything a World starts from, in NumPy."""

from dataclasses import dataclass
from typing import Any

from sim.scene.cloth import Sheet, build_sheet
from sim.scene.solids import Solids, build_solids
from sim.scene.water import Water, build_water


@dataclass
class SceneData:
    """solids always; water and sheet are None where their section is absent."""

    solids: Solids
    water: Water | None
    sheet: Sheet | None


def build_scene(config: Any) -> SceneData:
    """Raises ConfigError or CapacityError where the parts of the scene do not fit together."""
    finest = config.fluid.spacing if config.fluid else config.cloth.spacing
    solids = build_solids(config.solid, finest)
    water = build_water(config, solids) if config.fluid else None
    sheet = build_sheet(config.cloth) if config.cloth else None
    return SceneData(solids, water, sheet)
