"""One mass on springs, against its period."""

import math

import numpy as np

from sim.studies.case import Case, Point

ROUNDS = 3
STEPS = 100
"""To a period."""
STRETCH = 1.0
"""[N/m] Y of a fabric so soft that a hundredth of the period is a step that the clock takes."""
SPACING = 0.02
STRAIN = 1e-4


def period(area_density: float, spacing: float, stretch: float) -> float:
    """2 pi sqrt(m/k) [s] of the middle of a border with all else held: m = rho_A a^2/2; k = ks + kh = 9/8 Y.

    One structural spring of 3/4 Y along the swing, two diagonals of 3/8 Y at 45 degrees to it; those of the border
    stand across and do nothing.
    """
    return 2.0 * math.pi * math.sqrt(0.5 * area_density * spacing**2 / (9.0 / 8.0 * stretch))


def measure(world) -> dict[str, float]:
    """error: of the period, by where the velocity changes sign."""
    sheet, state = world.scene.sheet, world.state
    weights = np.zeros(9)
    weights[7] = 1.0 / sheet.mass[7]
    x = sheet.x.copy()
    x[7, 0] += STRAIN * sheet.spacing
    state["cloth.inv_mass"].from_numpy(weights)
    state["cloth.x"].from_numpy(x)
    expected = period(world.config.cloth.fabric.area_density, sheet.spacing, world.config.cloth.fabric.stretch)
    times, speeds = [0.0], [0.0]
    while times[-1] < ROUNDS * expected:
        world.step()
        times.append(world.clock.time)
        speeds.append(float(state["cloth.v"][7][0]))
    times, speeds = np.array(times), np.array(speeds)
    k = np.flatnonzero(speeds[1:-1] * speeds[2:] < 0.0) + 1
    crossings = times[k] - speeds[k] * (times[k + 1] - times[k]) / (speeds[k + 1] - speeds[k])
    found = 2.0 * float(np.diff(crossings).mean())
    return {"error": abs(found / expected - 1.0), "period": found}


def of(method: str, *more: str) -> Point:
    """A point of a method, a hundred steps to the period; forward Euler with threads damped as little as it needs."""
    step = period(0.15, SPACING, STRETCH) / STEPS
    given = (
        f"cloth.method={method}",
        "cloth.bending=none",
        f"cloth.size=[{2 * SPACING}, {2 * SPACING}]",
        f"cloth.spacing={SPACING}",
        f"cloth.fabric.stretch={STRETCH}",
        "run.fps=10",
        "run.duration=1 s",
        f"run.dt_max={step!r}",
        f"cloth.{method}.damping=0",
        f"cloth.{method}.substep_max={step!r}",
    )
    damped = (f"cloth.explicit_euler.retardation={2 * step!r}",) if method == "explicit_euler" else ()
    return Point((*given, *damped, *more), "f64")


CASE = Case(
    name="spring",
    scene="pull",
    reference="2 pi sqrt(m/k)",
    bounds={"error": 0.01},
    measure=measure,
    full=tuple(of(method) for method in ("explicit_euler", "implicit_euler", "symplectic_euler", "xpbd")),
    quick=(of("xpbd"),),
)
