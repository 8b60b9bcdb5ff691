"""Failures are named, placed and explained, and the clock keeps frames whole."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim import guard
from sim.clock import Clock
from sim.errors import DivergedError
from sim.stage import Limit, Stage, Suspect

SCENE = SimpleNamespace(
    emitter={"spout": SimpleNamespace(speed=0.5)},
    solid={},
    cloth=SimpleNamespace(method="xpbd", pins={}),
    fluid=SimpleNamespace(
        block={},
        ball={},
        terms=(),
        method="dfsph",
        expected_speed=None,
        params=SimpleNamespace(cfl=0.4),
        liquid=SimpleNamespace(rest_density=1000.0),
    ),
    space=SimpleNamespace(wind=None, gravity=(0.0, 0.0, -9.81), low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 0.3)),
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


def test_more_energy_than_there_was_is_an_explosion_however_slow_the_fastest():
    x, v, ids = np.zeros((40, 3)), np.zeros((40, 3)), np.arange(7, 47)
    v[:, 2] = 1.1 * guard.HEATED * guard.expected_speed(SCENE)
    guard.check_things("particle", x[:8], v[:8], ids[:8], 0.1, SCENE)
    with pytest.raises(DivergedError, match="exploding at t = 0.1 s, particle 7 at .* more energy than there was"):
        guard.check_things("particle", x, v, ids, 0.1, SCENE)
    guard.check_things("cloth node", x, v, ids, 0.1, SCENE)


def test_imploding_is_mean_density_or_a_quarter_of_the_water_in_clumps():
    x, ids = np.zeros((8, 3)), np.arange(8)
    guard.check_density(np.full(8, 1400.0), x, ids, 1.0, SCENE)
    guard.check_density(np.array([2100.0] * 2 + [900.0] * 6), x, ids, 1.0, SCENE)
    with pytest.raises(DivergedError, match="imploding at t = 1 s, particle 0 at .* the mean of all water, 1.6 x"):
        guard.check_density(np.full(8, 1600.0), x, ids, 1.0, SCENE)
    with pytest.raises(DivergedError, match="imploding .* 38 % of the water passes 2 x"):
        guard.check_density(np.array([900.0] * 5 + [2100.0] * 3), x, ids, 1.0, SCENE)


def test_standing_still():
    scene = SimpleNamespace(cloth=SimpleNamespace(self_contact=None))
    guard.check_standing(0.9 * guard.STANDING, 0.5, scene)
    with pytest.raises(DivergedError, match='standing still at t = 0.5 s: .* 80 % .*set cloth.self_contact = "robust"'):
        guard.check_standing(0.8, 0.5, scene)


def test_leaking():
    guard.check_leaks(0, 1.0)
    with pytest.raises(DivergedError, match="leaking at t = 1 s: 2 particles"):
        guard.check_leaks(2, 1.0)


def test_causes_of_this_failure_come_first_and_three_are_told():
    clock = Clock(10, 4e-3, 1e-6, obeys=False)
    clock.next_step(limited(1e-3))
    suspects = [Suspect("imploding", "mass"), Suspect("exploding", "sign"), Suspect("imploding", "clamp")]
    causes = guard.known_causes(SCENE, clock.overstep, tuple(suspects))
    with pytest.raises(
        DivergedError, match="; since t = 0 s dt = 4 ms is 4 x the water speed limit of 1 ms, .*; sign; "
    ):
        guard.check_things("particle", *things(41.0), 0.4, SCENE, causes)
    with pytest.raises(DivergedError, match=r"; mass; clamp; since .* \(and 1 more\)$"):
        guard.check_density(np.full(1, 1600.0), np.zeros((1, 3)), np.zeros(1, int), 1.0, SCENE, causes)


def test_sound_slower_than_water_is_a_cause_of_implosion():
    soft = SimpleNamespace(**{**vars(SCENE), "fluid": SimpleNamespace(**vars(SCENE.fluid))})
    soft.fluid.params = SimpleNamespace(sound_speed=1.0)
    (cause,) = guard.known_causes(soft, None)
    assert cause.failure == "imploding" and cause.words.startswith("sound at 1 m/s is slower than water at 2.5 m/s")


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


def test_a_clock_that_ignores_limits_keeps_the_first_that_it_broke():
    clock = Clock(10, 4e-3, 1e-6, obeys=False)
    assert clock.next_step(limited(3.8e-3)) == pytest.approx(4e-3) and clock.overstep is None
    clock.advance(4e-3)
    assert clock.next_step(limited(1e-3)) == pytest.approx(4e-3)
    clock.next_step(limited(1e-7))
    assert clock.overstep.limit == Limit(1e-3, "water speed") and clock.overstep.time == 4e-3
    obeying = Clock(10, 4e-3, 1e-6)
    assert obeying.next_step(limited(1e-3)) == pytest.approx(1e-3) and obeying.overstep is None
