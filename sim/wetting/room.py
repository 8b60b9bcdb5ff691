"""The wetting of a scene: its processes in their order, between the two ends of the exchange."""

from sim.errors import ConfigError
from sim.registry import method
from sim.stage import Build, Stage
from sim.wetting.cloth_water import ClothWater
from sim.wetting.merge import Merge
from sim.wetting.rejoin import Rejoin
from sim.wetting.supply import Supply

ORDER = ("absorb", "seep", "wick", "drip")
"""Pores ask before the film; what came in this step may wick and drip in it."""
NEEDS = {"seep": "absorb", "drip": "seep"}
"""A process and what fills what it empties."""
ROWS = (
    "fluid.x", "fluid.v", "fluid.mass", "fluid.mass_units", "fluid.triangle", "fluid.side", "cloth.x", "cloth.v",
    "cloth.mass", "cloth.inv_mass", "cloth.push_front", "cloth.push_back", "cloth.pressure_front",
    "cloth.pressure_back", "patch.pores", "patch.film",
)  # fmt: skip


def chosen(config) -> list[type]:
    """The classes of the scene's processes, in order. ConfigError where one lacks what it needs."""
    names = config.wetting.processes
    for name in names:
        if name in NEEDS and NEEDS[name] not in names:
            raise ConfigError(f"wetting.processes: {name} needs {NEEDS[name]}")
    if "drip" in names and not any(config.space.gravity):
        raise ConfigError("wetting.processes: drip needs gravity; without it no drop falls off")
    return [method("wetting", name) for name in ORDER if name in names]


def build_wetting(build: Build) -> list[Stage]:
    """Parts cloth_water, supply and each process by name; the stages of slot "wet"."""
    water = build.parts["cloth_water"] = ClothWater(build)
    classes = chosen(build.config)
    takes = any(cls.name in ("absorb", "seep") for cls in classes)
    stages = [
        Stage("wetting.begin", "wet", water.begin, reads=ROWS, writes=("cloth.pressure_front", "cloth.pressure_back"))
    ]
    if takes:
        supply = build.parts["supply"] = Supply(build, water)
        stages.append(Stage("wetting.touch", "wet", supply.begin, reads=ROWS))
    for cls in classes:
        part = build.parts[cls.name] = cls(build, build.config.wetting.params[cls.name])
        stages += part.stages()
        if cls.name == "seep" or (cls.name == "absorb" and not any(c.name == "seep" for c in classes)):
            mass = ("fluid.mass", "fluid.mass_units", "patch.pores", "patch.film")
            stages.append(Stage("wetting.soak", "wet", supply.transfer, reads=ROWS, writes=mass))
            stages += Merge(build).stages()
            if cls.name == "seep":
                stages += Rejoin(build).stages()
    nodes = ("cloth.v", "cloth.mass", "cloth.inv_mass")
    stages.append(Stage("wetting.weigh", "wet", water.settle, reads=ROWS, writes=nodes))
    return stages
