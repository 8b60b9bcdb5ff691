"""A clamped strip under its own weight, against the heavy elastica."""

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.cloth.rest import rows_held, settled

LENGTH = 0.1
"""[m] Free, from half a spacing before the last clamped row: bending acts at nodes, half a spacing to either side."""
STEPS = 400
METHODS = ("implicit_euler", "symplectic_euler", "xpbd")


def elastica(gamma: float) -> tuple[float, float]:
    """(drop, reach) over length of a clamped strip: theta'' = -Gamma (1 - s) cos theta, theta(0) = theta'(1) = 0.

    Gamma = rho_A g L^3/B. The slope at the clamp by bisection, the curve by Runge and Kutta's fourth order.
    Bickley 1934; drop/reach 0.1246, 1.067, 5.888 at Gamma 1, 10, 100.
    """
    low, high = 0.0, 2.0 * gamma + 1.0
    for _ in range(80):
        slope = 0.5 * (low + high)
        end, drop, reach = _shoot(slope, gamma)
        low, high = (slope, high) if end < 0.0 else (low, slope)
    return drop, reach


def _shoot(slope: float, gamma: float) -> tuple[float, float, float]:
    """theta'(1), drop and reach of the curve that leaves the clamp with this slope."""
    h, y = 1.0 / STEPS, np.array([0.0, slope, 0.0, 0.0])

    def rate(s: float, y: np.ndarray) -> np.ndarray:
        return np.array([y[1], -gamma * (1.0 - s) * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])])

    for k in range(STEPS):
        s = k * h
        a = rate(s, y)
        b = rate(s + 0.5 * h, y + 0.5 * h * a)
        c = rate(s + 0.5 * h, y + 0.5 * h * b)
        y = y + h / 6.0 * (a + 2.0 * b + 2.0 * c + rate(s + h, y + h * c))
        if abs(y[0]) > np.pi:  # over the top: this slope is far off
            break
    return y[1], y[2], y[3]


def measure(world) -> dict[str, float]:
    """error: of H/W at the tip. gamma by the fabric and the free length; strain, for springs stretch a little."""
    cloth, sheet = world.config.cloth, world.scene.sheet
    x, seconds = settled(world)
    held, a = rows_held(sheet), sheet.spacing
    length = (sheet.shape[0] - held + 0.5) * a
    weight = cloth.fabric.area_density * -world.config.space.gravity[2]
    gamma = weight * length**3 / cloth.fabric.bending
    middle = sheet.shape[1] // 2
    clamp, tip = x[held - 1, middle] - [0.5 * a, 0.0, 0.0], x[-1, middle]
    bent = (clamp[2] - tip[2]) / (tip[0] - clamp[0])
    drop, reach = elastica(gamma)
    error = abs(bent / (drop / reach) - 1.0) if tip[0] > clamp[0] else np.inf
    strain = world.build.parts["cloth"].max_strain()
    return {"error": error, "drop_over_reach": bent, "gamma": gamma, "strain": strain, **seconds}


def of(gamma: float, method: str, across: int, bending: str = "isometric") -> Point:
    """A point: so many spacings and a half of free strip, two rows clamped."""
    a = LENGTH / (across + 0.5)
    size = f"[{(across + 1) * a!r}, {2 * a!r}]"
    stiff = 0.15 * 9.81 * LENGTH**3 / gamma
    return Point(
        (
            f"cloth.method={method}",
            f"cloth.bending={bending}",
            f"cloth.size={size}",
            f"cloth.spacing={a!r}",
            f"cloth.pins.clamp.clip={a!r}",
            f"cloth.fabric.bending={stiff!r}",
        ),
        "f64",
    )


CASE = Case(
    name="cantilever",
    scene="cantilever",
    reference="heavy elastica, Bickley 1934",
    bounds={"error": 0.05},
    measure=measure,
    full=tuple(of(gamma, method, 20) for method in METHODS for gamma in (1.0, 10.0, 100.0)),
    quick=tuple(of(gamma, "xpbd", 10) for gamma in (1.0, 10.0, 100.0)),
)
