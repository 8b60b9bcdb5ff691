"""What a scene asks of a machine, in physical words: each constant that follows, which limit binds, what to change."""

from __future__ import annotations

import math
import os
from typing import Any

from sim import guard, registry, run
from sim.cloth.spectrum import top_frequency
from sim.errors import SeepError
from sim.fluid import roster
from sim.scene.build import SceneData, build_scene
from sim.schema import Config
from sim.search.pair_list import first_room
from sim.state import ROWS, Row

CORE_NANOSECONDS = {"dfsph": 2200.0, "wcsph": 900.0}
"""Of one core, a particle and step, at support 2, half of it for the list of pairs; measured on dam_break."""
OTHER_NANOSECONDS = 1500.0
PAIR_BYTES = 20
"""neighbour, weight and gradient of a pair."""
FIXED_BYTES = 150e6
"""Python, Taichi, and cells of the search."""
STREAM, FILM = 4, 2
"""[dx] A stream needs to be this wide to keep its shape, a film this thick to be seen as one."""
SIZES = {"f": 4, "v": 12, "i": 4, "m": 8}


def scene(conf: Config) -> str:
    """A screen about a scene, before anything is run; rows of a title and a text."""
    rows = [("scene", f"{conf.name}: {conf.title}")]
    try:
        data = build_scene(conf)
    except SeepError as error:
        return _lines([*rows, ("fails", str(error))])
    speed = guard.expected_speed(conf)
    rows += _water(conf, data) if conf.fluid else []
    rows += _cloth(conf) if conf.cloth else []
    rows.append(("speed", f"{speed:.2g} m/s expected{_of_speed(conf)}; {guard.EXPLODING:g} times that is exploding"))
    limits = sorted(_limits(conf), key=lambda limit: limit[0])
    rows += _substeps(conf, data) if conf.cloth else []
    rows += [("dt", f"{seconds:.2g} s by {what}") for seconds, what, _ in limits]
    rows.append(("binds", f"{limits[0][1]}; to step farther: {limits[0][2]}"))
    rows += _resolved(conf) if conf.fluid else []
    rows += _cost(conf, data, limits[0][0]) if conf.fluid else []
    rows += [("warning", text) for text in conf.warnings]
    if limits[0][0] < conf.run.dt_min:
        rows.append(("fails", f"starving: {limits[0][1]} asks for less than run.dt_min = {conf.run.dt_min:g} s"))
    failed = [folder for folder in run.runs(conf.name)[-1:] if folder.record().get("state") == "diverged"]
    rows += [("last run", f"{folder.label}: {folder.record().get('reason')}") for folder in failed]
    return _lines(rows)


def _lines(rows: list[tuple[str, str]]) -> str:
    return "\n".join(f"{title:9} {text}" for title, text in rows)


def _of_speed(conf: Config) -> str:
    return " (inflow, moving solids, a fall through space; or fluid.expected_speed)" if conf.fluid else ""


def _water(conf: Config, data: SceneData) -> list[tuple[str, str]]:
    water, now, most = conf.fluid, len(data.water.x), _particles(data, conf.run.duration)
    mass = water.liquid.rest_density * water.spacing**3
    neighbours = 4.0 / 3.0 * math.pi * water.support**3 - 1.0
    rows = [
        ("water", f"{most:,} particles of {_length(water.spacing)}, {now:,} of them at the start, {water.method}"),
        (
            "particle",
            f"{_mass(mass)} = rest_density spacing^3; half the spacing: 8 times as many, some 16 times the work",
        ),
        (
            "support",
            f"{_length(water.support_radius)} = {water.support:g} spacings, {neighbours:.0f} neighbours; 3 to validate",
        ),
    ]
    if sound := getattr(water.params, "sound_speed", None):
        ratio = guard.expected_speed(conf) / sound
        squeeze = (
            f"{sound:.3g} m/s; the water gives by (U/c)^2 = {100 * ratio**2:.2g} %: halve c, and dt doubles, this x 4"
        )
        rows.append(("sound", squeeze))
    if tolerance := getattr(water.params, "density_error", None):
        rows.append(
            ("solve", f"until the mean density is {100 * tolerance:.2g} % off; stricter: calmer, more iterations")
        )
    return rows


def _cloth(conf: Config) -> list[tuple[str, str]]:
    across, along = conf.cloth.node_counts
    triangles = 2 * (across - 1) * (along - 1)
    return [("cloth", f"{across} x {along} nodes, {triangles:,} triangles, {conf.cloth.method}")]


def _substeps(conf: Config, data: SceneData) -> list[tuple[str, str]]:
    """Within a step the sheet takes its own: how long they may be."""
    solver, params = registry.method("cloth.solver", conf.cloth.method), conf.cloth.params
    asked = params.substep_max
    if not hasattr(solver, "bound"):
        return [("substep", f"{asked:.2g} s by cloth.{solver.name}.substep_max; stable at every length")]
    omega = top_frequency(data.sheet)
    limit = solver.bound(params.retardation, omega)
    if not limit.seconds:
        return [("fails", f"{solver.name} without damping gains energy at every dt; set its retardation")]
    words = f"{limit.seconds:.2g} s, the limit of {limit.name}: the sheet's fastest swing is {omega:.3g} 1/s"
    return [("substep", words if not asked or asked > limit.seconds else f"{asked:.2g} s, under {words}")]


def _limits(conf: Config) -> list[tuple[float, str, str]]:
    """(seconds, its name, what would raise it) of each bound of the time step, at the speed expected."""
    limits = [
        (conf.run.dt_max, "run.dt_max", "raise it"),
        (1.0 / conf.run.fps, "one frame", "lower run.fps"),
    ]
    if not conf.fluid:
        return limits
    water, speed = conf.fluid, guard.expected_speed(conf)
    smoothing, nu, gamma = 0.5 * water.support_radius, water.liquid.nu, water.liquid.surface_tension
    if hasattr(water.params, "sound_limit"):
        seconds = water.params.sound_limit(water).seconds
        limits.append((seconds, "sound speed, 0.4 h/(c (1 + 0.6 alpha))", "a lower sound_speed, or method dfsph"))
    if cfl := getattr(water.params, "cfl", None):
        limits.append(
            (cfl * water.spacing / speed, "water moving, cfl dx/U", "a larger spacing, slower water or a higher cfl")
        )
    if nu > 0 and "viscosity" in water.terms:
        limits.append(
            (0.125 * smoothing**2 / nu, "viscosity, 0.125 h^2/nu", "a larger spacing, or an implicit viscosity")
        )
    if gamma > 0 and any("tension" in term or "cohesion" in term for term in water.terms):
        seconds = 0.25 * math.sqrt(water.liquid.rest_density * smoothing**3 / (2.0 * math.pi * gamma))
        limits.append((seconds, "surface tension, 0.25 sqrt(rho h^3/(2 pi gamma))", "a larger spacing"))
    return limits


def _resolved(conf: Config) -> list[tuple[str, str]]:
    """What the spacing shows, and what it does not."""
    dx, rows = conf.fluid.spacing, []
    for name, emitter in conf.emitter.items():
        wide = emitter.diameter / dx
        verdict = (
            ""
            if wide >= STREAM
            else f"; under {STREAM}: ragged, take a spacing of {_length(emitter.diameter / STREAM)}"
        )
        rows.append(("nozzle", f"{name}: {_length(emitter.diameter)}, {wide:.1f} spacings across{verdict}"))
    thin = {name: _thinnest(solid) / dx for name, solid in conf.solid.items()}
    for name, wide in thin.items():
        if wide < 1.0:
            rows.append(("wall", f"{name}: {wide:.1f} spacings thick; water on both sides of it feels the other side"))
    gravity = math.sqrt(sum(g * g for g in conf.space.gravity))
    if gravity > 0 and conf.fluid.liquid.surface_tension > 0:
        puddle = 2.0 * math.sqrt(conf.fluid.liquid.surface_tension / (conf.fluid.liquid.rest_density * gravity))
        seen = "seen" if puddle > FILM * dx else f"not seen: under {FILM} spacings they are single particles"
        rows.append(("films", f"a puddle is {_length(puddle)} high, {puddle / dx:.1f} spacings: {seen}"))
    return rows


def _thinnest(solid: Any) -> float:
    """[m]"""
    if solid.shape == "box":
        return min(solid.size)
    if solid.shape == "cylinder":
        return min(2.0 * solid.radius, solid.length)
    return {"basin": getattr(solid, "thickness", math.inf)}.get(solid.shape, math.inf)


def _cost(conf: Config, data: SceneData, dt: float) -> list[tuple[str, str]]:
    classes = roster.methods(conf)
    names = {name for cls in classes for name in cls.rows}
    rows = [row for row in ROWS.values() if row.name in names] + [row for cls in classes for row in cls.scratch]
    capacity = data.water.capacity
    each = sum(_bytes(row) for row in rows if row.name.startswith("fluid."))
    memory = FIXED_BYTES + capacity * (each + PAIR_BYTES * first_room(conf.fluid.support))
    steps = conf.run.duration / dt
    mean = 0.5 * (len(data.water.x) + _particles(data, conf.run.duration))
    work = CORE_NANOSECONDS.get(conf.fluid.method, OTHER_NANOSECONDS) * (conf.fluid.support / 2.0) ** 3
    cores = conf.run.threads or os.cpu_count() or 1
    seconds = steps * (mean * work * 1e-9 / cores + 2e-3)
    rate = seconds / conf.run.duration
    return [
        ("memory", f"{memory / 1e9:.2g} GB for up to {capacity:,} particles"),
        ("time", f"{_time(seconds)} for {steps:,.0f} steps on {cores} cores, give or take a factor of 3"),
        ("pace", f"{rate:.2g} s per simulated second"),
    ]


def _bytes(row: Row) -> int:
    """Saved rows have a spare, to be sorted into."""
    return SIZES[row.dtype] * (2 if row.saved else 1)


def _particles(data: SceneData, duration: float) -> int:
    return len(data.water.x) + sum(stream.emitted(duration) for stream in data.water.streams)


def _length(metres: float) -> str:
    return f"{1e3 * metres:.3g} mm"


def _mass(kilograms: float) -> str:
    return f"{1e6 * kilograms:.3g} mg" if kilograms < 1e-3 else f"{1e3 * kilograms:.3g} g"


def _time(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.2g} s"
    return f"{seconds / 60.0:.2g} min" if seconds < 5400.0 else f"{seconds / 3600.0:.2g} h"
