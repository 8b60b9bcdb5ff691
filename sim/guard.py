"""Is this still physics? Each failure is named, located and explained; the run stops with its last good state."""

import math

import numpy as np

from sim.errors import DivergedError
from sim.preset import expected_speed
from sim.stage import Suspect

EXPLODING = 10.0
"""[1] times the expected speed. Splashes reach 2 to 3 times; a failed pressure solve passes 10 within a frame."""
HEATED = 1.25
"""[1] times the expected speed, root mean square over the water: 1.6 times the energy that all of it can have got."""
CROWD = 30
"""Particles from which on a mean over them means something: of two, one may have the energy of both."""
IMPLODING = 1.5
"""[1] times the rest density, mean over the water: no splash compresses all of it by half."""
CLUMPED = (2.0, 0.25)
"""[1] times the rest density, passed by this share of the water. Good scenes reach 1.3 in single particles."""
STANDING = 0.5
"""[1] Share of a frame in which water and cloth stood still: more is no pinch that passes."""
TOLD = 3
"""Causes that a line names; of further ones, their number."""


def check_things(
    what: str, x: np.ndarray, v: np.ndarray, ids: np.ndarray, time: float, config, suspects: tuple[Suspect, ...] = ()
) -> None:
    """NaN and speed of particles or nodes. what: "particle" or "cloth node"; x, v (n, 3); raises DivergedError.

    suspects: what is known to be wrong with the run (see `known_causes`), told instead of a general remedy.
    """
    if not len(x):
        return
    cause = _told("exploding", suspects) or _remedy(what, config)
    broken = ~(np.isfinite(x).all(1) & np.isfinite(v).all(1))
    if broken.any():
        raise DivergedError(
            f"NaN at t = {time:.4g} s, {what} {ids[broken.argmax()]}: {broken.sum()} of {len(x)} are not numbers; "
            f"{cause}"
        )
    speed = np.sqrt((v.astype(np.float64) ** 2).sum(1))
    expected = expected_speed(config)
    worst = int(speed.argmax())
    where = f"exploding at t = {time:.4g} s, {what} {ids[worst]} at {_place(x[worst])}: {speed[worst]:.3g} m/s"
    if speed[worst] > EXPLODING * expected:
        raise DivergedError(f"{where} passes {EXPLODING:g} x expected {expected:.2g} m/s; {cause}")
    mean = math.sqrt((speed**2).mean())
    if what == "particle" and len(x) >= CROWD and mean > HEATED * expected:
        raise DivergedError(
            f"{where}, and the mean of all water, {mean:.3g} m/s, passes {HEATED:g} x expected {expected:.2g} m/s: "
            f"more energy than there was; {cause}"
        )


def check_density(
    density: np.ndarray, x: np.ndarray, ids: np.ndarray, time: float, config, suspects: tuple[Suspect, ...] = ()
) -> None:
    """Density of the water (n,) by the particles' true masses [kg/m^3]; x (n, 3); raises DivergedError."""
    if not len(density):
        return
    ratio = density / config.fluid.liquid.rest_density
    worst = int(ratio.argmax())
    limit, share = CLUMPED
    dense = float((ratio > limit).mean())
    if ratio.mean() > IMPLODING:
        passed = f"the mean of all water, {ratio.mean():.3g} x, passes {IMPLODING:g} x"
    elif dense > share:
        passed = f"{100 * dense:.0f} % of the water passes {limit:g} x"
    else:
        return
    raise DivergedError(
        f"imploding at t = {time:.4g} s, particle {ids[worst]} at {_place(x[worst])}: {ratio[worst]:.3g} x rest "
        f"density, and {passed}; {_told('imploding', suspects) or _remedy('particle', config)}"
    )


def check_leaks(leaks: int, time: float) -> None:
    """A crossing that no process booked and the last step could not undo; raises DivergedError."""
    if leaks:
        raise DivergedError(
            f"leaking at t = {time:.4g} s: {leaks} particles crossed the cloth; lower run.dt_max or fluid.dfsph.cfl"
        )


def check_standing(share: float, time: float, config) -> None:
    """share: of the last frame, in steps that the last step took back whole; raises DivergedError."""
    if share > STANDING:
        remedy = "lower run.dt_max" if config.cloth.self_contact else 'set cloth.self_contact = "robust"'
        raise DivergedError(
            f"standing still at t = {time:.4g} s: water is pinched between layers of cloth, and {100 * share:.0f} % of "
            f"the frame's time was taken back, more than {100 * STANDING:g} %; {remedy}"
        )


def known_causes(config, overstep, suspects: tuple[Suspect, ...] = ()) -> tuple[Suspect, ...]:
    """All that is known to be wrong with a run.

    overstep: the first step that broke a limit (sim.clock.Overstep) or None. suspects: settings that the water's
    methods know to fail. A gas whose sound is slower than its water cannot hold it either.
    """
    found = [Suspect("exploding", str(overstep)), *suspects] if overstep else [*suspects]
    sound = getattr(config.fluid.params, "sound_speed", None)
    if sound and sound < expected_speed(config):
        words = f"sound at {sound:.2g} m/s is slower than water at {expected_speed(config):.2g} m/s, make it 10 x"
        found.append(Suspect("imploding", words))
    return tuple(found)


def _told(failure: str, suspects: tuple[Suspect, ...]) -> str:
    """Those that lead to this failure first."""
    words = [s.words for s in sorted(suspects, key=lambda s: s.failure != failure)]
    return "; ".join(words[:TOLD]) + (f" (and {len(words) - TOLD} more)" if len(words) > TOLD else "")


def _place(x: np.ndarray) -> str:
    return f"({', '.join(f'{c:.3g}' for c in x)})"


def _remedy(what: str, config) -> str:
    if what != "particle":
        return f"lower cloth.{config.cloth.method}.substep_max"
    cfl = hasattr(getattr(config.fluid, "params", None), "cfl")
    return f"lower fluid.{config.fluid.method}.cfl" if cfl else "lower run.dt_max"
