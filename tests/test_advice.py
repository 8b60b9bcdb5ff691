"""What follows from spacing, liquid and expected speed, and what doctor says of it."""

import pytest

from sim import advice, config

POOL = """
schema = 1
[run]
duration = "1 s"
[space]
low = [0.0, 0.0, 0.0]
high = [0.1, 0.1, 0.2]
[fluid]
spacing = "2 mm"
method = "wcsph"
[fluid.block.pool]
low = [0.0, 0.0, 0.0]
high = [0.1, 0.1, 0.02]
[emitter.spout]
centre = [0.05, 0.05, 0.15]
speed = "1 m/s"
rate = "40 ml/s"
[solid.floor]
shape = "plane"
"""


def told(scene_file, *settings: str) -> dict[str, str]:
    """Row title -> text; of several rows of a title the first."""
    text = advice.scene(config.load(scene_file(POOL), settings))
    assert len(text.splitlines()) <= 24
    return {line[:9].strip(): line[10:] for line in reversed(text.splitlines())}


def test_sound_follows_from_inflow_and_a_fall(scene_file):
    fluid = config.load(scene_file(POOL)).fluid
    assert fluid.expected_speed == pytest.approx((1.0 + 2.0 * 9.81 * 0.2) ** 0.5)
    assert fluid.params.sound_speed == pytest.approx(10.0 * fluid.expected_speed)


@pytest.mark.parametrize("setting, sound", [("fluid.expected_speed=0.5", 5.0), ("fluid.wcsph.sound_speed=7", 7.0)])
def test_what_a_scene_says_goes(scene_file, setting, sound):
    assert config.load(scene_file(POOL), [setting]).fluid.params.sound_speed == sound


def test_a_moving_wall_makes_water_fast(scene_file):
    wall = ["solid.floor.path={times = [0, 1], shift = [[0, 0, 0], [4, 0, 0]]}"]
    fluid = config.load(scene_file(POOL), wall).fluid
    assert fluid.expected_speed == pytest.approx((6.0**2 + 2.0 * 9.81 * 0.2) ** 0.5)


def test_each_constant_is_told_with_the_limit_that_binds(scene_file):
    rows = told(scene_file)
    assert rows["particle"].startswith("7.99 mg = rest_density spacing^3")
    assert rows["support"].startswith("4 mm = 2 spacings, 33 neighbours")
    assert rows["sound"].startswith("22.2 m/s; the water gives by (U/c)^2 = 1 %")
    assert rows["binds"].startswith("sound speed") and rows["dt"].startswith("3.4e-05 s by sound speed")
    assert rows["water"].startswith("30,000 particles of 2 mm, 25,000 of them at the start")
    assert told(scene_file, "fluid.method=dfsph")["binds"].startswith("water moving, cfl dx/U")


def test_what_the_spacing_does_not_show_is_told(scene_file):
    rows = told(scene_file)
    assert "3.6 spacings across; under 4: ragged, take a spacing of 1.78 mm" in rows["nozzle"]
    assert "puddle is 5.45 mm high, 2.7 spacings: seen" in rows["films"]
    assert "not seen" in told(scene_file, "fluid.spacing=2.3 mm", "fluid.liquid.surface_tension=0.02")["films"]


def test_steps_beyond_the_limit_are_told_before_the_run(scene_file):
    """5 ms at 2.2 m/s, where 0.4 spacings take 0.36 ms."""
    long = ("fluid.method=dfsph", "run.dt_max=5 ms")
    assert "warning" not in told(scene_file, *long)
    warning = told(scene_file, *long, "run.dt_limits=false")["warning"]
    assert warning.startswith("run.dt_limits = false: dt = 5 ms is 14 x the water speed limit of 0.36 ms")


@pytest.mark.parametrize(
    "setting, words",
    [
        ("fluid.particles_max=20000", "fluid.particles_max = 20000: 30000 particles will come"),
        ("run.dt_min=1 ms", "starving: sound speed"),
    ],
)
def test_why_it_must_fail_is_told_before_it_does(scene_file, setting, words):
    assert words in told(scene_file, setting)["fails"]
