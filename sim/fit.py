"""Whether the sections of a scene fit together: what one model cannot see of another."""

from __future__ import annotations

import math

from sim.explain import Problem
from sim.preset import expected_speed
from sim.schema import Config

NOZZLE_SPACINGS = 3
"""A stream narrower than this many particles is no stream: its lattice has one or two of them across."""

COUNT_MAX = 2**31 - 1
"""Particles or nodes that an index of 32 bits can name."""

TENSION_SUPPORT = 2.5
"""[dx] A drop of 10 spacings' radius rings with 21.7 ms at 3, 23.6 at 2.5, 19.3 at 2, there but once; the liquid's are
23.3."""


def problems(config: Config) -> list[Problem]:
    """Everything that does not fit, in the order of the scene's sections."""
    parts = (_run, _counts, _water, _periodic, _streams, _cloth, _exchange)
    return [problem for part in parts for problem in part(config)]


def _counts(config: Config) -> list[Problem]:
    """Things too many to number, before anything is made of them."""
    found, fluid, cloth = [], config.fluid, config.cloth
    if fluid:
        each = fluid.spacing**3
        asked = [("fluid.spacing", sum(body.volume for body in fluid.bodies) / each)]
        for name, stream in config.emitter.items():
            lattice = 0.25 * math.pi * (stream.diameter / fluid.spacing) ** 2
            asked.append((f"emitter.{name}.rate", max(stream.rate * config.run.duration / each, lattice)))
        found += [Problem(key, _too_many(count, "particles")) for key, count in asked if count > COUNT_MAX]
    if cloth:
        count = math.prod(side / cloth.spacing for side in cloth.size)
        found += [Problem("cloth.spacing", _too_many(count, "nodes"))] if count > COUNT_MAX else []
    return found


def _too_many(count: float, things: str) -> str:
    return f"makes {count:.3g} {things}; at most {COUNT_MAX:,} can be numbered"


def warnings(config: Config) -> tuple[str, ...]:
    """What is allowed and yet seldom meant."""
    found = []
    if config.fluid and config.cloth and not config.coupling:
        found.append("[fluid] and [cloth] without [coupling] do not feel each other")
    if config.fluid and not config.emitter and not config.fluid.bodies:
        found.append("[fluid] without [emitter.NAME], [fluid.block.NAME] or [fluid.ball.NAME] has no water")
    if config.fluid and "surface_tension" in config.fluid.terms and config.fluid.support < TENSION_SUPPORT:
        found.append(
            f"fluid.support = {config.fluid.support:g} is too short for surface_tension: under {TENSION_SUPPORT:g} the "
            "particles' own order pulls as hard as the surface"
        )
    if config.cloth and config.cloth.method == "explicit_euler" and not config.cloth.params.retardation:
        found.append(
            "cloth.method = explicit_euler without damping gains energy at every dt and fails; set "
            "cloth.explicit_euler.retardation, or take symplectic_euler"
        )
    if beyond := _beyond(config):
        found.append(beyond)
    return tuple(found)


def _beyond(config: Config) -> str:
    """Steps that ignore how fast water moves: a pressure solve survives any, and nothing else would tell."""
    cfl = getattr(getattr(config.fluid, "params", None), "cfl", None)
    if config.run.dt_limits or not cfl:
        return ""
    dt, limit = min(config.run.dt_max, 1.0 / config.run.fps), cfl * config.fluid.spacing / expected_speed(config)
    if dt <= limit:
        return ""
    return (
        f"run.dt_limits = false: dt = {1e3 * dt:.3g} ms is {dt / limit:.2g} x the water speed limit of "
        f"{1e3 * limit:.2g} ms; particles pass neighbours unseen, so water loses energy, if it does not fail"
    )


def _run(config: Config) -> list[Problem]:
    found = []
    if config.run.frame_count < 1:
        found.append(Problem("run.duration", f"shorter than one frame at {config.run.fps} frames per second"))
    if config.run.dt_min >= config.run.dt_max:
        found.append(Problem("run.dt_min", "must be below run.dt_max"))
    if not config.fluid and not config.cloth:
        found.append(Problem("fluid", "missing, and so is [cloth]: there is nothing to simulate"))
    return found


def _water(config: Config) -> list[Problem]:
    fluid, space = config.fluid, config.space
    if not fluid:
        return [
            Problem(kind, f"needs [fluid]: without water there is nothing to {verb}")
            for kind, verb in (("emitter", "pour"), ("drain", "swallow"))
            if getattr(config, kind)
        ]
    if space.low is None or space.high is None:
        missing = [k for k in ("low", "high") if getattr(space, k) is None]
        return [Problem(f"space.{k}", "missing; [fluid] needs a box to be in") for k in missing]
    found = [
        Problem(f"solid.{name}.no_slip", "needs a viscosity among fluid.terms")
        for name, solid in config.solid.items()
        if solid.no_slip and not any("viscosity" in term for term in fluid.terms)
    ]
    if {"viscosity", "implicit_viscosity"} <= set(fluid.terms):
        found.append(Problem("fluid.terms", "viscosity and implicit_viscosity are one force taken twice; keep one"))
    found += [
        Problem(f"fluid.{kind}.{name}", "must lie within space.low and space.high")
        for kind, bodies in (("block", fluid.block), ("ball", fluid.ball))
        for name, body in bodies.items()
        if not (_inside(body.low, space) and _inside(body.high, space))
    ]
    return _method(fluid) + found


def _periodic(config: Config) -> list[Problem]:
    """Images of a particle must not meet, lattices must close, and solids and cloth must not see the seam."""
    space, fluid = config.space, config.fluid
    if not space.periodic:
        return []
    key = "space.periodic"
    if len(set(space.periodic)) < len(space.periodic):
        return [Problem(key, "names an axis twice")]
    if config.cloth or not fluid:
        return [Problem(key, "is for [fluid] alone: cloth has two ends")]
    if space.low is None or space.high is None:
        return []
    found = []
    for axis, (low, high) in ((a, (space.low[n], space.high[n])) for n, a in enumerate("xyz") if a in space.periodic):
        if high - low < 2.0 * fluid.support_radius * (1.0 - 1e-9):
            least = f"must be at least two support radii, {2.0 * fluid.support_radius:g} m"
            found.append(Problem(key, f"space is {high - low:g} m long in {axis}; it {least}"))
        for name, block in fluid.block.items():
            found += _lattice_closes(f"fluid.block.{name}", block, axis, (low, high), fluid.spacing)
        found += [p for name, s in config.solid.items() for p in _closes(f"solid.{name}", s, axis, (low, high))]
    return found


def _lattice_closes(key: str, block, axis: str, ends: tuple, spacing: float) -> list[Problem]:
    """A block from face to face meets itself: where it does, its particles must be a spacing apart."""
    n = "xyz".index(axis)
    if block.low[n] > ends[0] or block.high[n] < ends[1]:
        return []
    count = (ends[1] - ends[0]) / spacing
    if math.isclose(count, round(count), rel_tol=1e-6):
        return []
    even = (ends[1] - ends[0]) / round(count)
    return [Problem(key, f"fills periodic {axis}, and fluid.spacing must go evenly into it; {even:.6g} m does")]


def _closes(key: str, solid, axis: str, ends: tuple) -> list[Problem]:
    n = "xyz".index(axis)
    if solid.shape == "plane":
        return [Problem(key, f"normal must be across periodic {axis}")] if solid.normal[n] else []
    centre = getattr(solid, "centre", None)
    if centre is None or ends[0] <= centre[n] <= ends[1]:
        return []
    return [Problem(key, f"centre must lie within space along periodic {axis}")]


def _method(fluid) -> list[Problem]:
    found = []
    if fluid.method == "mueller" and "viscosity" in fluid.terms:
        found.append(Problem("fluid.terms", 'the method "mueller" has its own viscosity; leave this one out'))
    if fluid.method != "mueller" and fluid.kernel == "mueller":
        found.append(Problem("fluid.kernel", 'is two kernels, of the method "mueller" alone; choose wendland_c2'))
    if fluid.method in ("dfsph", "pbf") and fluid.mover == "explicit_euler":
        text = f'the method "{fluid.method}" solves for the way it goes; choose symplectic_euler'
        found.append(Problem("fluid.mover", text))
    return found


def _streams(config: Config) -> list[Problem]:
    if not config.fluid:
        return []
    found = []
    least = NOZZLE_SPACINGS * config.fluid.spacing
    for name, emitter in config.emitter.items():
        if emitter.diameter < least:
            found.append(
                Problem(
                    f"emitter.{name}.rate",
                    f"makes a nozzle of {emitter.diameter * 1e3:.1f} mm; it must be {NOZZLE_SPACINGS} spacings wide, "
                    f"{least * 1e3:.1f} mm: raise the rate, or lower the speed or fluid.spacing",
                )
            )
        if config.space.low and config.space.high and not _inside(emitter.centre, config.space):
            found.append(Problem(f"emitter.{name}.centre", "must lie within space.low and space.high"))
    return found


def _cloth(config: Config) -> list[Problem]:
    if not config.cloth:
        return []
    cloth = config.cloth
    across, along = cloth.node_counts
    mesh = [Problem("cloth.spacing", _mesh(side, cloth.spacing)) for side in dict.fromkeys(cloth.size)]
    pins = [
        Problem(f"cloth.pins.{name}.where", f"has a node outside [0, 0] to [{across - 1}, {along - 1}]")
        for name, pin in cloth.pins.items()
        if not isinstance(pin.where, str) and any(i >= across or j >= along for i, j in pin.where)
    ]
    still = [
        Problem(f"cloth.pins.{name}.path", 'needs cloth.method = "xpbd"')
        for name, pin in cloth.pins.items()
        if pin.path and cloth.method != "xpbd"
    ]
    return [problem for problem in mesh if problem.text] + pins + still + _guests(config)


def _guests(config: Config) -> list[Problem]:
    """What takes part in the substeps of one solver alone."""
    found = []
    if config.cloth.self_contact and config.cloth.method != "xpbd":
        found.append(Problem("cloth.self_contact", 'needs cloth.method = "xpbd"'))
    if config.space.wind and config.cloth.method != "xpbd":
        found.append(Problem("space.wind", 'needs cloth.method = "xpbd"'))
    return found


def _mesh(side: float, spacing: float) -> str:
    """What keeps the mesh from fitting this side; "" if it fits."""
    patches = round(side / spacing)
    if patches < 2:
        return f"must go at least twice into {side:g} m"
    if not math.isclose(patches * spacing, side, rel_tol=1e-6):
        return f"must go evenly into {side:g} m; {side / patches:.6g} m does"
    return ""


def _exchange(config: Config) -> list[Problem]:
    found = []
    if config.coupling and not (config.fluid and config.cloth):
        missing = "fluid" if not config.fluid else "cloth"
        found.append(Problem("coupling", f"needs [fluid] and [cloth]; [{missing}] is missing"))
    if config.coupling and config.cloth and config.cloth.method != "xpbd":
        text = "feels no water: [coupling] is solved inside the substeps of xpbd; choose xpbd or leave [coupling] out"
        found.append(Problem("cloth.method", text))
    if config.wetting and not config.coupling:
        found.append(Problem("wetting", "needs [coupling]"))
    if config.coupling and config.coupling.contact == "plane_reflect":
        found += _reflecting(config)
    return found


def _reflecting(config: Config) -> list[Problem]:
    """What the report's contact does not know."""
    found = []
    if config.wetting:
        found.append(Problem("coupling.contact", 'has no water at rest on the cloth for [wetting]; choose "ccd"'))
    for key in ("restitution", "friction"):
        if getattr(config.coupling, key) != type(config.coupling).model_fields[key].default:
            found.append(
                Problem(f"coupling.{key}", "plane_reflect sends all water back as fast as it came; leave it out")
            )
    return found


def _inside(point, space) -> bool:
    return all(low <= p <= high for low, p, high in zip(space.low, point, space.high))
