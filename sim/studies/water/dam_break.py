"""A breaking dam against Martin & Moyce's front."""

import math

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import row

WIDTH = 57.15e-3
"""[m] a: of the column, which is twice as high."""
FRONT = np.array([(1.0, 1.32), (1.5, 1.75), (2.0, 2.35), (2.5, 2.99), (3.0, 3.70)])
"""(T, Z): front Z = x/a at T = t sqrt(2 g/a).   Martin & Moyce 1952, Table 2, between its rows"""
SHIFTS = np.linspace(0.0, 0.25, 101)
"""T0: how much later than ours the experiment's water is free; its gate takes time to open."""


def measure(world) -> dict[str, float]:
    """error: rms of Z/Z_seen - 1 after the best shift T0 of 0 to 0.25; error_unshifted: without one; compression."""
    gravity, dx = -world.config.space.gravity[2], world.config.fluid.spacing
    rate = math.sqrt(2.0 * gravity / WIDTH)
    block = next(iter(world.config.fluid.block.values()))
    foremost = round((block.high[1] - block.low[1]) / dx)
    times, fronts, dense = [0.0], [1.0], []
    while times[-1] < FRONT[-1, 0]:
        world.step()
        times.append(world.clock.time * rate)
        fronts.append((np.sort(row(world, "x")[:, 0])[-foremost:].mean() + 0.5 * dx) / WIDTH)
        dense.append(np.maximum(row(world, "density") / world.config.fluid.liquid.rest_density - 1.0, 0.0).mean())
    errors = [_rms(times, fronts, shift) for shift in SHIFTS]
    best = int(np.argmin(errors))
    return {
        "error": errors[best],
        "shift": SHIFTS[best],
        "error_unshifted": errors[0],
        "compression": float(np.mean(dense)),
    }


def _rms(times, fronts, shift: float) -> float:
    ratio = np.interp(FRONT[:, 0] - shift, times, fronts) / FRONT[:, 1]
    return float(np.sqrt(np.mean((ratio - 1.0) ** 2)))


def _points(spacing: str) -> tuple[Point, ...]:
    return tuple(Point((f"fluid.method={method}", f"fluid.spacing={spacing}")) for method in ("dfsph", "wcsph"))


LONG = Point(("fluid.method=dfsph", "fluid.spacing=3.571875 mm", "run.dt_max=4 ms", "fluid.dfsph.cfl=0.8"))
"""Twice the step that dfsph asks for: at the column's foot solves fail, and calm water must come of it all the same."""


CASE = Case(
    name="dam_break",
    scene="dam_break",
    reference="Martin & Moyce 1952, Table 2",
    bounds={"error": 0.04},
    measure=measure,
    full=(*_points("3.571875 mm"), LONG),
    quick=_points("7.14375 mm"),
)
