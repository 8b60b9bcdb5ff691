"""A drop sits on a plate: the angle at which it meets it."""

import math

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row

SETTLED = 0.7
"""[1] of the run: height is a mean over what is left."""


def measure(world) -> dict[str, float]:
    """angle [deg] of the spherical cap of the drop's volume whose middle is as high; error: over that asked, less 1."""
    fluid, heights = world.config.fluid, []
    while world.clock.time < world.config.run.duration - 1e-9:
        world.step()
        if world.clock.time > SETTLED * world.config.run.duration:
            heights.append(row(world, "x")[:, 2].mean())
    volume = int(world.state.count[None]) * fluid.spacing**3
    asked, angles = fluid.term_params["surface_tension"].contact_angle, np.linspace(0.02, math.pi, 2000)
    found = np.interp(np.mean(heights), [_middle(a, volume) for a in angles], angles)
    return {"error": found / asked - 1.0, "angle": math.degrees(found)}


def _middle(angle: float, volume: float) -> float:
    """Height of the centre of mass of a cap [m]."""
    c = math.cos(angle)
    radius = (3.0 * volume / (math.pi * (2.0 + c) * (1.0 - c) ** 2)) ** (1.0 / 3.0)
    return radius * (0.75 * (1.0 + c) ** 2 / (2.0 + c) - c)


CASE = Case(
    name="sessile",
    scene="sessile",
    reference="Young 1805: a cap of the asked contact angle",
    bounds={"error": 0.12},
    measure=measure,
    full=tuple(Point((f"fluid.surface_tension.contact_angle={angle} deg",)) for angle in (60, 90)),
    quick=(),
)
