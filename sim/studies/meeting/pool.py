"""A pool in a hung sheet: what the clips carry, and how its pressure on the sheet grows with depth."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.meeting.load import Load, depth_by_mass, node_areas
from sim.studies.probe import row

WINDOW = 0.5
"""[s] Means are over this time, at the end of the run."""
EACH = 10
"""Steps between two looks at where the water is."""


def measure(world: Any) -> dict[str, float]:
    """Figures of the run's end, means over WINDOW.

    h is the depth of the water over a node, by the mass above it (see depth_by_mass): its surface as it is, not fitted.
    p is contact impulse over area and time.

    error   rms over depth, layers of a spacing from two down, each of eight nodes or more, of mean p/(rho_0 g h) - 1
    brim    the same where h is less than two spacings, too thin to be water: what it lacks the deeper nodes carry
    pins    force of the clips over the weight of cloth and water - 1
    caught  share of particle-steps in which the last step acted
    leaks   crossings
    speed   rms of the water at the end [m/s]
    """
    load, end, particle_steps, seen = Load(world), world.config.run.duration, 0, []
    while world.clock.time < end - 1e-9:
        if not load.watching and world.clock.time >= end - WINDOW - 1e-9:
            load.begin()
        world.step()
        particle_steps += int(world.state.count[None])
        if load.watching and world.clock.step % EACH == 0:
            seen.append(np.column_stack([row(world, "x"), row(world, "mass")]))
    counts = world.build.parts["contact"].counts()
    sheet, x = world.scene.sheet, load.places()
    on_cloth = row(world, "x")[:, 2] > x[:, 2].min()
    water = row(world, "mass")[on_cloth].sum()
    g = -world.config.space.gravity[2]
    cloth = world.state["cloth.mass"].to_numpy().astype(float).sum()
    rest, dx = world.config.fluid.liquid.rest_density, world.config.fluid.spacing
    samples = np.concatenate(seen)
    samples = samples[samples[:, 2] > x[:, 2].min()]
    area = node_areas(x * [1.0, 1.0, 0.0], sheet.triangles)
    depth = depth_by_mass(x, sheet.triangles, samples[:, :3], samples[:, 3] / len(seen), rest)
    pushes, weighs = load.pressure() * area, rest * g * depth * area
    thin = depth < 2.0 * dx
    return {
        "error": _by_depth(np.floor(depth / dx).astype(int), pushes, weighs),
        "brim": pushes[thin].sum() / weighs[thin].sum() - 1.0,
        "pins": load.carried()[2] / (g * (cloth + water)) - 1.0,
        "caught": counts["caught"] / particle_steps,
        "leaks": counts["leaks"],
        "on_cloth": float(on_cloth.mean()),
        "depth": depth.max(),
        "speed": float(np.sqrt((row(world, "v")[on_cloth] ** 2).sum(1).mean())),
    }


def _by_depth(layer: np.ndarray, pushes: np.ndarray, weighs: np.ndarray) -> float:
    """rms over layers from the second on, each of eight nodes or more, of push over weight - 1."""
    deep = [layer == k for k in np.unique(layer) if k >= 2 and (layer == k).sum() >= 8]
    return float(np.sqrt(np.mean([(pushes[at].sum() / weighs[at].sum() - 1.0) ** 2 for at in deep])))


CASE = Case(
    name="pool",
    scene="pool",
    reference="hydrostatics: pins = weight, p = rho g h",
    bounds={"error": 0.03, "pins": 0.01, "caught": 1e-4, "leaks": 0.0},
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
