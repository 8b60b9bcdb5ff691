"""The water of a scene, part by part, in building order."""

from typing import Any

from sim.fluid.motion import Motion
from sim.fluid.pairs import Pairs
from sim.fluid.population import Population
from sim.fluid.walls import Walls
from sim.registry import method
from sim.stage import Build, Stage, Suspect


def methods(config: Any) -> list[type]:
    """Every class whose rows and scratch the water of this scene needs."""
    fluid = config.fluid
    terms = [method("fluid.term", name) for name in fluid.terms]
    search, pressure = method("search", fluid.search), method("fluid.pressure", fluid.method)
    mover = method("fluid.mover", fluid.mover)
    return [Population, search, Pairs, Walls, Motion, mover, *terms, pressure]


def sizes(water) -> dict[str, int]:
    """Entries a row of state in the groups that the water uses."""
    return {"fluid": water.capacity, "scene": 1}


def build_fluid(build: Build) -> list[Stage]:
    """Build the parts into build.parts (population, search, pairs, walls, pressure), fill in t = 0; the stages."""
    fluid = build.config.fluid
    search, pressure = method("search", fluid.search), method("fluid.pressure", fluid.method)
    parts = [Population(build), search(build, search.Params()), Pairs(build)]
    Walls(build)
    # A term acts on pairs within "forces", or by stages of its own, or both.
    terms = tuple(method("fluid.term", name)(build, fluid.term_params.get(name)) for name in fluid.terms)
    parts.append(pressure(build, fluid.params, tuple(term for term in terms if hasattr(term, "acceleration"))))
    parts += [term for term in terms if hasattr(term, "stages")]
    build.parts["population"].reset()
    return [stage for part in parts for stage in part.stages()]


def suspects(build: Build) -> tuple[Suspect, ...]:
    """Settings of this scene's water that are known to fail, as its methods tell them."""
    pressure = build.parts["pressure"]
    return tuple(found for part in (pressure, pressure.motion.mover) for found in getattr(part, "suspects", tuple)())
