"""A topic: its cases, found in sim/studies/<topic>/, and what configs/studies/<topic>.toml sweeps them over."""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from typing import Literal

from pydantic import Field, ValidationError

from sim import config, explain, registry, toml
from sim.errors import ConfigError
from sim.model import Model, option
from sim.studies.case import Case

KINDS = {"fluid": "fluid.pressure", "cloth": "cloth.solver"}
"""What a study sweeps: the methods of this section of a scene."""


class Steps(Model):
    """[sweep.CASE.METHOD]: every setting is run with every dt."""

    dt: tuple[str, ...] = option((), why="run.dt_max, of cloth the substep, such as 1 ms; left out: the scene's")
    settings: tuple[tuple[str, ...], ...] = option(((),), why="KEY=VALUE texts laid over the scene together")


class Sweep(Model):
    """[sweep.CASE]: the case's figure `error` over seconds per simulated second, for method x dt x spacing."""

    spacing: tuple[str, ...] = option((), why="of particles or mesh; left out: as the scene has it")
    overrides: tuple[str, ...] = option((), why="KEY=VALUE texts of every point")
    skip: tuple[str, ...] = option((), why="methods that this is no case for")
    precision: Literal["f32", "f64"] = option("f32", why="of every point")
    method: dict[str, Steps] = Field(default_factory=dict)


class Study(Model):
    """configs/studies/<topic>.toml."""

    title: str = option("")
    section: Literal["fluid", "cloth"] = option("fluid", why="whose methods are swept")
    report: str = option("", why="the method that the 2019 report used; marked on the chart")
    levels: tuple[float, ...] = option((0.1, 0.03, 0.01), why="errors at which the cheapest point is named")
    sweep: dict[str, Sweep] = Field(default_factory=dict)

    @property
    def kind(self) -> str:
        """Of the methods swept, as the registry has it."""
        return KINDS[self.section]


def load(topic: str, quick: bool = False) -> Study:
    """The study file, with [quick] laid over it where asked. ConfigError: one line that names file, key and value."""
    if topic not in (topics := [name for name in config.names("studies") if cases(name)]):
        raise ConfigError(f"{topic}: no such chart; there are {', '.join(topics)}")
    path = config.find("studies", topic)
    label = f"configs/studies/{path.name}"
    table = toml.read(path, label)
    over = table.pop("quick", {})
    if quick:
        table = toml.lay_over(table, over, label, {})
    try:
        study = Study.model_validate(table)
    except ValidationError as error:
        key, text = explain.problem(error.errors()[0], Study, table)
        raise ConfigError(f"{label}: {key}: {text}") from None
    registry.discover()
    known, there = registry.methods(study.kind), cases(topic)
    for name, sweep in study.sweep.items():
        if name not in there:
            raise ConfigError(f"{label}: sweep.{name}: no such case; there are {', '.join(there) or 'none'}")
        for method in (*sweep.method, *sweep.skip):
            if method not in known:
                raise ConfigError(f"{label}: sweep.{name}.method.{method}: choose from {', '.join(known)}")
    return study


def cases(topic: str) -> dict[str, Case]:
    """The CASE, or CASES, of every module in sim/studies/<topic>/, by name."""
    folder = f"sim.studies.{topic}"
    found = topic.isidentifier() and importlib.util.find_spec(folder)
    if not found or not found.submodule_search_locations:  # none, or a module and no folder
        return {}
    package = importlib.import_module(folder)
    modules = [importlib.import_module(m.name) for m in pkgutil.iter_modules(package.__path__, folder + ".")]
    found = [vars(module).get("CASES", (vars(module).get("CASE"),)) for module in modules]
    return {case.name: case for some in found for case in some if case}
