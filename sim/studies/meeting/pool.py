"""A pool in a hung sheet: what the clips carry, and how its pressure on the sheet grows with depth."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.meeting.load import Load, level, node_areas
from sim.studies.probe import row

WINDOW = 0.5
"""[s] Means are over this time, at the end of the run."""


def measure(world: Any) -> dict[str, float]:
    """Figures of the run's end.

    error   rms over depth, layers of a spacing from two down, of mean p/(rho g h) - 1; p contact impulse over area and
            time, h depth under the level at which p vanishes (one number, fitted to p = rho g h)
    level   that level over the one to which the water's mass fills the sheet [spacings]: lower, for about the brim,
            where water is thinner than a particle, more of it stands than there is room for
    pins    force of the clips over the weight of cloth and water - 1
    caught  share of particle-steps in which the last step acted
    leaks   crossings
    speed   rms of the water at the end [m/s]
    """
    load, end, particle_steps = Load(world), world.config.run.duration, 0
    while world.clock.time < end - 1e-9:
        if not load.watching and world.clock.time >= end - WINDOW - 1e-9:
            load.begin()
        world.step()
        particle_steps += int(world.state.count[None])
    counts = world.build.parts["contact"].counts()
    sheet, x = world.scene.sheet, load.places()
    on_cloth = row(world, "x")[:, 2] > x[:, 2].min()
    water = row(world, "mass")[on_cloth].sum()
    g = -world.config.space.gravity[2]
    cloth = world.state["cloth.mass"].to_numpy().astype(float).sum()
    rest, dx = world.config.fluid.liquid.rest_density, world.config.fluid.spacing
    depth = level(x, sheet.triangles, water / rest) - x[:, 2]
    area, deep = node_areas(x * [1.0, 1.0, 0.0], sheet.triangles), depth >= 2.0 * dx
    pressure = load.pressure()
    shift = ((pressure / (rest * g) - depth) * area)[deep].sum() / area[deep].sum()
    return {
        "error": _by_depth(shift + depth, pressure, rest * g, area, dx),
        "level": shift / dx,
        "pins": load.carried()[2] / (g * (cloth + water)) - 1.0,
        "caught": counts["caught"] / particle_steps,
        "leaks": counts["leaks"],
        "on_cloth": float(on_cloth.mean()),
        "depth": depth.max(),
        "speed": float(np.sqrt((row(world, "v")[on_cloth] ** 2).sum(1).mean())),
    }


def _by_depth(depth: np.ndarray, pressure: np.ndarray, weight: float, area: np.ndarray, dx: float) -> float:
    """rms over layers, each of eight nodes or more, of mean pressure over weight [N/m^3] x mean depth - 1, by area."""
    layer = np.floor(depth / dx).astype(int)
    deep = [layer == k for k in np.unique(layer) if k >= 2 and (layer == k).sum() >= 8]
    share = [(pressure * area)[at].sum() / (weight * (depth * area)[at].sum()) for at in deep]
    return float(np.sqrt(np.mean((np.array(share) - 1.0) ** 2)))


CASE = Case(
    name="pool",
    scene="pool",
    reference="hydrostatics: pins = weight, p = rho g h",
    bounds={"error": 0.03, "level": 0.5, "pins": 0.01, "caught": 1e-4, "leaks": 0.0},
    measure=measure,
    full=(Point(),),
    quick=(
        Point(
            ("fluid.spacing=4 mm", "cloth.spacing=1 cm", "run.duration=2.5 s", "emitter.spout.rate=100 ml/s",
             "emitter.spout.speed=0.3 m/s", "emitter.spout.centre=[0,0,0.2]", "emitter.spout.stop=0.8 s"),
            bounds={"error": 0.05},
        ),
    ),
)  # fmt: skip
