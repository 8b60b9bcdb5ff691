"""Periodic space: no place in it is special, nothing leaves it, and what cannot close is refused."""

import numpy as np
import pytest

from sim.config import load
from sim.errors import ConfigError
from tests.spawned import open_world, spawn

RING = """
schema = 1
[run]
duration = "1 s"
fps = 20
[space]
gravity = [0.3, -0.2, 0.1]
low = [-0.02, 0.0, 0.01]
high = [0.02, 0.036, 0.042]
periodic = ["x", "y", "z"]
[fluid]
spacing = "4 mm"
method = "wcsph"
[fluid.wcsph]
sound_speed = "5 m/s"
[fluid.liquid]
rest_density = 1000.0
nu = "1e-3 m^2/s"
surface_tension = 0.0
[fluid.block.all]
low = [-0.02, 0.0, 0.01]
high = [0.02, 0.036, 0.042]
"""
LOW, SIZE = np.array([-0.02, 0.0, 0.01]), np.array([0.04, 0.036, 0.032])


def _set(world, name: str, values: np.ndarray) -> None:
    field = world.state[f"fluid.{name}"]
    whole = field.to_numpy()
    whole[: len(values)] = values
    field.from_numpy(whole)


def _by_id(world, name: str) -> np.ndarray:
    count = world.state.count[None]
    return world.state[f"fluid.{name}"].to_numpy()[:count][np.argsort(world.state["fluid.id"].to_numpy()[:count])]


def _step(world, dt: float) -> None:
    for stage in world.stages:
        stage.run(dt)


def _ring(path: str) -> dict:
    world = open_world(path, precision="f64")
    rest, count = _by_id(world, "x"), world.state.count[None]
    random = np.random.default_rng(5)
    v = random.normal(0.0, 0.3, (count, 3))
    x = rest + random.uniform(-1e-3, 1e-3, (count, 3))
    seen = []
    for shift in ([0.0, 0.0, 0.0], [0.0131, -0.0272, 0.0099], [0.02, 0.018, 0.016]):
        world.build.parts["population"].reset()
        _set(world, "x", LOW + (x + shift - LOW) % SIZE)
        _set(world, "v", v)
        _step(world, 1e-4)
        # Columns: density, velocity after the step, place after the step, moved back.
        place = (_by_id(world, "x") - shift - x + 0.5 * SIZE) % SIZE - 0.5 * SIZE
        seen.append(np.column_stack([_by_id(world, "density"), _by_id(world, "v"), place]))
    world.build.parts["population"].reset()
    _set(world, "v", np.tile([1.0, -2.0, 0.5], (count, 1)))
    for _ in range(200):
        _step(world, 1e-4)
    flow = {name: _by_id(world, name) for name in ("x", "v", "density")}
    return {"seen": np.array(seen), "start": v, "count": (count, world.state.count[None]), **flow}


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    path = tmp_path_factory.mktemp("ring") / "scene.toml"
    path.write_text(RING)
    return spawn(_ring, str(path))


def test_a_shift_of_all_particles_changes_nothing(ring):
    first, *others = ring["seen"]
    change = np.abs(first[:, 1:4] - ring["start"]).max()
    assert change > 0.01
    for other in others:
        assert other == pytest.approx(first, abs=1e-9 * change, rel=1e-9)


def test_momentum_changes_by_gravity_alone(ring):
    gained = ring["seen"][0][:, 1:4].mean(0) - ring["start"].mean(0)
    assert gained == pytest.approx(1e-4 * np.array([0.3, -0.2, 0.1]), rel=1e-6)


def test_a_lattice_that_fills_the_ring_flows_as_one(ring):
    """0.02 s at (1, -2, 0.5) m/s: round once in y; at rest in its own frame, nothing drained."""
    assert ring["count"] == (10 * 9 * 8,) * 2
    assert ring["density"] == pytest.approx(np.full(720, 1000.0), rel=1e-9)
    assert ring["v"] == pytest.approx(np.tile(np.array([1.0, -2.0, 0.5]) + 0.02 * np.array([0.3, -0.2, 0.1]), (720, 1)))
    assert (ring["x"] >= LOW).all() and (ring["x"] <= LOW + SIZE).all()


WRONG = {
    'space.periodic=["x", "w"]': "choose from x, y, z",
    'space.periodic=["x", "x"]': "names an axis twice",
    "space.high=[0.02, 0.036, 0.025]": "it must be at least two support radii, 0.016 m",
    "space.high=[0.021, 0.036, 0.042]": "fluid.spacing must go evenly into it",
    'solid.floor={shape="plane", normal=[0, 0, 1]}': "solid.floor: normal must be across periodic z",
    'solid.ball={shape="sphere", centre=[0, 0, 1], radius=0.01}': "solid.ball: centre must lie within space",
    "cloth.size=[0.1, 0.1]": "cloth has two ends",
}


@pytest.mark.parametrize("setting, words", WRONG.items())
def test_what_cannot_close_is_refused_in_one_line(scene_file, setting, words):
    block = ["fluid.block.all.high=" + setting.split("=")[1]] if setting.startswith("space.high") else []
    with pytest.raises(ConfigError) as error:
        load(scene_file(RING), [setting, *block])
    assert words in str(error.value) and "\n" not in str(error.value)
