"""Is this still physics? Each failure is named, located and explained; the run stops with its last good state."""

import numpy as np

from sim.errors import DivergedError
from sim.preset import expected_speed

EXPLODING = 10.0
"""[1] times the expected speed. Splashes reach 2 to 3 times; a failed pressure solve passes 10 within a frame."""
IMPLODING = 1.5
"""[1] times the rest density, mean over the water: no splash compresses all of it by half."""


def check_things(what: str, x: np.ndarray, v: np.ndarray, ids: np.ndarray, time: float, config) -> None:
    """NaN and speed of particles or nodes. what: "particle" or "cloth node"; x, v (n, 3); raises DivergedError."""
    if not len(x):
        return
    broken = ~(np.isfinite(x).all(1) & np.isfinite(v).all(1))
    if broken.any():
        raise DivergedError(
            f"NaN at t = {time:.4g} s, {what} {ids[broken.argmax()]}: {broken.sum()} of {len(x)} are not numbers; "
            f"{_remedy(what, config)}"
        )
    speed = np.sqrt((v.astype(np.float64) ** 2).sum(1))
    limit = EXPLODING * expected_speed(config)
    if speed.max() > limit:
        worst = int(speed.argmax())
        place = ", ".join(f"{c:.3g}" for c in x[worst])
        raise DivergedError(
            f"exploding at t = {time:.4g} s, {what} {ids[worst]} at ({place}): {speed[worst]:.3g} m/s passes "
            f"{EXPLODING:g} x expected {limit / EXPLODING:.2g} m/s; {_remedy(what, config)}"
        )


def check_density(density: np.ndarray, time: float, config) -> None:
    """Mean density of all water [kg/m^3]; raises DivergedError."""
    if len(density) and density.mean() > IMPLODING * config.fluid.liquid.rest_density:
        raise DivergedError(
            f"imploding at t = {time:.4g} s: mean density {density.mean():.4g} kg/m^3 passes {IMPLODING:g} x rest "
            f"density; {_remedy('particle', config)}"
        )


def check_leaks(leaks: int, time: float) -> None:
    """A crossing that no process booked and the last step could not undo; raises DivergedError."""
    if leaks:
        raise DivergedError(
            f"leaking at t = {time:.4g} s: {leaks} particles crossed the cloth; lower run.dt_max or fluid.dfsph.cfl"
        )


def _remedy(what: str, config) -> str:
    if what == "particle":
        return f"lower {_steps(config.fluid.method)}"
    return "lower cloth.xpbd.substep_max"


def _steps(method: str) -> str:
    return "fluid.dfsph.cfl" if method == "dfsph" else "run.dt_max"
