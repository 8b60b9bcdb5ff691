"""Terms: tension rounds a cube and keeps its momentum; thick liquid is calmed as it should, at any step."""

import numpy as np
import pytest

from sim.errors import DivergedError
from sim.studies.probe import row
from tests.spawned import open_world, spawn

CUBE = """
schema = 1
[run]
duration = "0.1 s"
fps = 200
dt_max = "2 ms"
[space]
gravity = [0.0, 0.0, 0.0]
low = [-0.01, -0.01, -0.01]
high = [0.01, 0.01, 0.01]
[fluid]
spacing = "0.4 mm"
support = 3.0
terms = ["viscosity", "surface_tension"]
[fluid.liquid]
card = "water"
nu = "2e-5 m^2/s"
[fluid.block.cube]
low = [-0.0016, -0.0016, -0.0016]
high = [0.0016, 0.0016, 0.0016]
velocity = [0.05, 0.02, -0.01]
"""

WAVE = """
schema = 1
[run]
duration = "1 s"
fps = 100
dt_max = "10 ms"
[space]
gravity = [0.0, 0.0, 0.0]
low = [0.0, 0.0, 0.0]
high = [0.06, 0.12, 0.06]
periodic = ["x", "y", "z"]
[fluid]
spacing = "1 cm"
support = 3.0
terms = ["implicit_viscosity"]
expected_speed = "0.1 m/s"
[fluid.dfsph]
cfl = 1.0
[fluid.liquid]
rest_density = 1000.0
nu = "0.05 m^2/s"
surface_tension = 0.0
[fluid.block.all]
low = [0.0, 0.0, 0.0]
high = [0.06, 0.12, 0.06]
"""


def _moments(world) -> dict:
    x, v = row(world, "x"), row(world, "v")
    return {"momentum": v.mean(0), "spin": np.cross(x - x.mean(0), v - v.mean(0)).mean(0), "speed": np.abs(v).mean()}


def _roundness(world) -> float:
    """Farthest particle from the centre over the mean distance: 2.0 of a cube's lattice, 1.33 of a ball."""
    away = row(world, "x")
    away = np.linalg.norm(away - away.mean(0), axis=1)
    return float(away.max() / away.mean())


def _cube(path: str) -> dict:
    world = open_world(path)
    start, before = world.save(), _roundness(world)
    limit = min(s.limit().seconds for s in world.stages if s.name == "forces")
    found = {"before": before, "limit": limit, "first": _moments(world)}
    world.clock.cap = world.clock.cap._replace(seconds=0.9 * limit)
    for _ in range(5):
        world.advance()
    found |= {"after": _roundness(world), "last": _moments(world), "dt": world.clock.time / world.clock.step}
    world.load(start)
    world.clock.obeys = False
    world.clock.cap = world.clock.cap._replace(seconds=32.0 * limit)
    try:
        for _ in range(6):
            world.advance()
    except DivergedError as error:
        found["said"] = str(error)
    return found


def _wave(path: str) -> dict:
    world = open_world(path)
    x = row(world, "x")
    field = world.state["fluid.v"]
    v = field.to_numpy()
    wave = np.sin(2.0 * np.pi * x[:, 1] / 0.12)
    v[: len(x)] = 0.0
    v[: len(x), 0] = 0.1 * wave
    field.from_numpy(v)
    amplitudes = []
    for _ in range(3):
        world.advance()
        x = row(world, "x")
        amplitudes.append(float(2.0 * (row(world, "v")[:, 0] * np.sin(2.0 * np.pi * x[:, 1] / 0.12)).mean()))
    return {
        "amplitudes": amplitudes,
        "dt": world.clock.time / world.clock.step,
        "drift": np.abs(row(world, "v").mean(0)),
    }


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    path = tmp_path_factory.mktemp("cube") / "scene.toml"
    path.write_text(CUBE)
    return spawn(_cube, str(path))


def test_tension_pulls_a_cube_round_and_leaves_its_momentum(cube):
    assert cube["before"] > 1.5 and cube["after"] < 1.35
    assert np.abs(cube["last"]["momentum"] - cube["first"]["momentum"]).max() < 1e-6
    assert cube["dt"] > 0.8 * cube["limit"]


def test_a_step_far_beyond_the_limit_of_tension_fails_and_the_guard_names_it(cube):
    """This cube is twenty times as thick as water: it holds at 8 times the limit, and from 10 times on is torn apart,
    no faster than splashes are."""
    assert "imploding" in cube["said"] and "x the surface tension limit of 0.17 ms" in cube["said"]


def test_a_thick_wave_dies_as_backward_euler_has_it_at_eighteen_times_the_explicit_limit(tmp_path):
    """A(n) = A(0)/(1 + nu k^2 dt)^n; the form of the term gives 0.97 of nu at this support, the lattice less."""
    path = tmp_path / "scene.toml"
    path.write_text(WAVE)
    wave = spawn(_wave, str(path))
    first, second = wave["amplitudes"][:2]
    k_sq = (2.0 * np.pi / 0.12) ** 2
    assert wave["dt"] == pytest.approx(0.01)
    assert (0.1 / second) ** 0.5 - 1.0 == pytest.approx(0.05 * k_sq * 0.01, rel=0.15)
    assert first > second > 0.0 and np.max(wave["drift"]) < 1e-6


def _explicit_wave(path: str) -> str:
    world = open_world(path, 'fluid.terms=["viscosity"]')
    field, count = world.state["fluid.v"], int(world.state.count[None])
    v = field.to_numpy()
    v[:count, 0] = 0.1 * np.sin(2.0 * np.pi * row(world, "x")[:, 1] / 0.12)
    field.from_numpy(v)
    world.clock.obeys = False
    try:
        for _ in range(12):
            world.advance()
    except DivergedError as error:
        return str(error)
    return "held"


def test_the_same_wave_explodes_with_explicit_viscosity_at_that_step(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(WAVE)
    said = spawn(_explicit_wave, str(path))
    assert "exploding" in said and "viscosity limit" in said


def _honey() -> dict:
    from sim.studies.water.honey import SLOWLY, measure

    world = open_world("honey", *SLOWLY, "fluid.spacing=2.5 mm", "run.duration=0.8 s", quick=True)
    found = measure(world)
    water = int(world.state.count[None]) * world.config.fluid.spacing**3
    poured = world.config.emitter["spoon"].rate * world.clock.time
    return found | {"share": water / poured, "dt": world.clock.time / world.clock.step}


def test_honey_spreads_as_slowly_as_it_should_and_stays_on_its_plate():
    """A tenth of its viscosity comes 15 % farther; a step at explicit viscosity's limit is 0.17 ms."""
    honey = spawn(_honey)
    assert honey["error"] < 0.06 and honey["dt"] > 1e-3
    assert honey["lowest"] > 0.0 and honey["speed"] < 1.2 and honey["share"] == pytest.approx(1.0, abs=0.05)


def _caps() -> list[float]:
    """Heights of a small drop's middle [mm] on plates that it meets at 30 and at 80 degrees."""
    world = open_world("sessile", "fluid.spacing=0.36 mm", "fluid.liquid.nu=1e-4 m^2/s")
    term, start, heights = world.build.parts["pressure"].motion.terms[1], world.save(), []
    for angle in (30.0, 80.0):
        world.load(start)
        term.adhesion = term.adhesive(np.radians(angle))
        for _ in range(4):
            world.advance()
        heights.append(1e3 * float(row(world, "x")[:, 2].mean()))
    return heights


def test_a_drop_lies_lower_on_a_plate_that_it_wets_more():
    """A half ball is 0.66 mm high in the middle; main.py chart water holds a finer one to its angles."""
    wetted, round_ = spawn(_caps)
    assert wetted < 0.8 * round_ and 0.5 < round_ < 0.8
