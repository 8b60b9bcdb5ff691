"""Why a scene fails: its causes mended one at a time, and left in one at a time, each run in its own process."""

from __future__ import annotations

import csv
import io
import math
import multiprocessing
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import Field, ValidationError

from sim import checkpoint, config, explain, guard, toml
from sim.errors import ConfigError, DivergedError
from sim.model import REQUIRED, Model, option

COLUMNS = (
    "run", "mended", "words", "failure", "time", "max_speed", "mean_speed", "density", "speed_bound", "density_bound",
    "duration", "overrides", "message",
)  # fmt: skip
"""Of ablate.csv, a row each run. run: "as it is", "mended alone", "left alone" or "all mended"; mended: the cause that
the row is about; failure, time [s]: what the guard said first, empty if nothing; max_speed [m/s]: of any particle at
any frame; mean_speed [m/s] (rms) and density [rho0] (mean): of all water, at the worst frame; the guard's bounds."""

PLACES = ("run", "time", "x", "y", "z")
"""Of places.csv [s, m], a row each particle, as it is and all mended: at the end, or where an implosion is densest."""


class Cause(Model):
    """[cause.NAME]: words for the chart, and what is laid over the scene to be rid of it."""

    words: str = option(REQUIRED)
    set: tuple[str, ...] = option(REQUIRED)


class Study(Model):
    """configs/studies/ablate.toml."""

    cause: dict[str, Cause] = Field(default_factory=dict)


class Trial(NamedTuple):
    """One run: what it is called, the cause that it is about ("" for none), and what is laid over the scene."""

    run: str
    cause: str
    overrides: tuple[str, ...]


def load() -> Study:
    """The causes. ConfigError: one line that names file and key."""
    path = config.find("studies", "ablate")
    label = f"configs/studies/{path.name}"
    table = toml.read(path, label)
    table.pop("schema", None)
    try:
        return Study.model_validate(table)
    except ValidationError as error:
        found = explain.problem(error.errors()[0], Study, table)
        raise ConfigError(f"{label}: {found.key}: {found.text}") from None


def trials(study: Study) -> list[Trial]:
    """The scene as it is, each cause mended alone, all mended, each left in alone."""
    causes = study.cause

    def without(names) -> tuple[str, ...]:
        return tuple(text for name in names for text in causes[name].set)

    alone = [Trial("mended alone", name, without([name])) for name in causes]
    left = [Trial("left alone", name, without(n for n in causes if n != name)) for name in causes]
    return [Trial("as it is", "", ()), *alone, Trial("all mended", "", without(causes)), *left]


def run(scene: str, out: Path, settings: tuple[str, ...] = (), threads: int = 0) -> Iterator[dict[str, Any]]:
    """Run every trial of a scene and yield its row; then out/ablate.csv and, of the two ends, out/places.csv.

    settings: KEY=VALUE texts under all trials. ConfigError before the first run if one of them does not fit.
    """
    study = load()
    plan = trials(study)
    for trial in plan:
        config.load(scene, [*settings, *trial.overrides])
    rows, places = [], []
    for trial in plan:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            figures, (time, x) = pool.apply(_run, (scene, (*settings, *trial.overrides), threads))
        words = study.cause[trial.cause].words if trial.cause else ""
        named = {"run": trial.run, "mended": trial.cause, "words": words, "overrides": " ".join(trial.overrides)}
        rows.append({**named, **figures})
        if not trial.cause:
            places += [{"run": trial.run, "time": time, "x": a, "y": b, "z": c} for a, b, c in x]
        yield rows[-1]
    out.mkdir(parents=True, exist_ok=True)
    write_table(out / "ablate.csv", COLUMNS, rows)
    write_table(out / "places.csv", PLACES, places)


def _run(scene: str, overrides: tuple[str, ...], threads: int) -> tuple[dict[str, Any], tuple[float, list]]:
    """The child: what `measure` finds."""
    from sim import runtime
    from sim.world import World

    conf = config.load(scene, overrides)
    runtime.start(conf.run.arch, threads or conf.run.threads or None, conf.run.precision)
    world = World(conf)
    answer = measure(world)
    runtime.stop()
    return answer


def measure(world: Any) -> tuple[dict[str, Any], tuple[float, list]]:
    """Run to the end, past the guard's first word (not past a NaN or a starving step), and keep the worst.

    Figures as in COLUMNS; a time and the places (n, 3) of the water then, as in PLACES.
    """
    figures = dict.fromkeys(("max_speed", "mean_speed", "density"), 0.0)
    first: tuple[str, float, str] = ("", math.nan, "")
    densest = _places(world)
    ended = False
    while world.frame_index < world.frame_count and not ended:
        try:
            world.advance()
        except DivergedError as error:
            kind = str(error).split()[0]
            first = first if first[0] else (kind, world.clock.time, str(error))
            ended = kind in ("NaN", "starving")
        if not ended:
            row = world.ledger_row()
            now = (row["max_speed"], math.sqrt(2.0 * row["kinetic_energy"] / row["free"]), _density(world))
            densest = _places(world) if now[2] > figures["density"] else densest
            figures = {name: max(worst, value) for (name, worst), value in zip(figures.items(), now)}
    figures |= {"failure": first[0], "time": first[1], "message": first[2], "duration": world.clock.time}
    figures |= {"speed_bound": guard.HEATED * guard.expected_speed(world.config), "density_bound": guard.IMPLODING}
    return figures, densest if first[0] == "imploding" else _places(world)


def _density(world: Any) -> float:
    """Mean density of the water by true masses [rho0]."""
    density = world.build.parts["pairs"].density()[: world.state.count[None]]
    return float(density.mean()) / world.config.fluid.liquid.rest_density


def _places(world: Any) -> tuple[float, list]:
    return world.clock.time, world.state["fluid.x"].to_numpy()[: world.state.count[None]].tolist()


def write_table(path: Path, columns: tuple[str, ...], rows: list[dict[str, Any]]) -> None:
    """A CSV, whole or not at all; numbers to six digits, nan as an empty cell."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    checkpoint.write_text(path, text.getvalue())


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def verdict(rows: list[dict[str, Any]]) -> str:
    """Which cause mattered, in a sentence: the one whose mending alone ends the failure."""
    failure = rows[0]["failure"]
    if not failure:
        return "it does not fail"
    cured = [row["words"] for row in rows if row["run"] == "mended alone" and not row["failure"]]
    bad = [f"{row['words']} ({row['failure']})" for row in rows if row["run"] == "left alone" and row["failure"]]
    ends = f"mending one alone ends it: {', '.join(cured)}" if cured else "no single mending ends it"
    brings = f"fails the mended alone: {', '.join(bad)}" if bad else "none fails the mended alone"
    return f"{failure} at {rows[0]['time']:.3g} s; {ends}; {brings}"
