"""Failures are named, placed and explained, and the clock keeps frames whole."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim import guard
from sim.clock import Clock
from sim.errors import DivergedError
from sim.stage import Limit, Stage

SCENE = SimpleNamespace(
    emitter={"spout": SimpleNamespace(speed=0.5)},
    solid={},
    fluid=SimpleNamespace(block={}, method="dfsph", expected_speed=None, liquid=SimpleNamespace(rest_density=1000.0)),
    space=SimpleNamespace(gravity=(0.0, 0.0, -9.81), low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 0.3)),
)


def things(speed: float):
    x = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]], np.float32)
    return x, np.array([[0.0, 0.0, 0.0], [speed, 0.0, 0.0]], np.float32), np.array([7, 311])


def test_expected_speed_is_inflow_and_a_fall_through_space():
    assert guard.expected_speed(SCENE) == pytest.approx(np.sqrt(0.5**2 + 2 * 9.81 * 0.3))


def test_what_is_fast_but_possible_passes():
    guard.check_things("particle", *things(0.9 * guard.EXPLODING * guard.expected_speed(SCENE)), 0.4, SCENE)


def test_exploding_names_particle_place_and_remedy():
    with pytest.raises(
        DivergedError, match=r"exploding at t = 0.412 s, particle 311 at \(0.4, 0.5, 0.6\): 41 m/s .*cfl"
    ):
        guard.check_things("particle", *things(41.0), 0.412, SCENE)


def test_nan_is_counted():
    x, v, ids = things(1.0)
    x[0, 1] = np.nan
    with pytest.raises(DivergedError, match="NaN at t = 0.1 s, cloth node 7: 1 of 2 are not numbers"):
        guard.check_things("cloth node", x, v, ids, 0.1, SCENE)


def test_imploding_and_leaking():
    guard.check_density(np.full(4, 1400.0), 1.0, SCENE)
    with pytest.raises(DivergedError, match="imploding"):
        guard.check_density(np.full(4, 1600.0), 1.0, SCENE)
    guard.check_leaks(0, 1.0)
    with pytest.raises(DivergedError, match="leaking at t = 1 s: 2 particles"):
        guard.check_leaks(2, 1.0)


def limited(seconds: float) -> list[Stage]:
    return [Stage("x", "move", print, limit=lambda: Limit(seconds, "water speed"))]


def test_steps_divide_the_frame_evenly():
    clock, steps = Clock(30, 2e-3, 1e-6), []
    ended = False
    while not ended:
        steps.append(clock.next_step(limited(7e-4)))
        ended = clock.advance(steps[-1])
    assert clock.bound.name == "water speed"
    assert max(steps) <= 7e-4 and max(steps) == pytest.approx(min(steps), rel=1e-9)
    assert clock.frame == 1 and clock.elapsed == 0.0
    assert sum(steps) == pytest.approx(1 / 30)


@pytest.mark.parametrize("seconds", [5e-7, float("nan")])
def test_starving_names_the_limit(seconds):
    with pytest.raises(DivergedError, match="starving at t = 0 s: the water speed limit"):
        Clock(30, 2e-3, 1e-6).next_step(limited(seconds))
