"""Solids that move on a path: what water and cloth make of them; a scene runs once, in its own process."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim.errors import ConfigError
from sim.scene.course import Course
from tests.spawned import open_world, spawn

BUSY = """
schema = 1
[run]
duration = "0.16 s"
fps = 50
[space]
low = [-0.1, -0.05, -0.05]
high = [0.3, 0.05, 0.2]
[fluid]
spacing = "4 mm"
[fluid.block.water]
low = [0.0, -0.02, 0.0]
high = [0.1, 0.02, 0.032]
[emitter.left]
centre = [0.22, 0.0, 0.12]
speed = "0.5 m/s"
rate = "80 ml/s"
stop = "0.05 s"
[emitter.right]
centre = [0.22, 0.0, 0.02]
direction = [1.0, 0.0, 0.0]
speed = "0.8 m/s"
rate = "100 ml/s"
start = "0.01 s"
stop = "0.08 s"
[drain.below]
low = [0.19, -0.05, 0.04]
high = [0.25, 0.05, 0.08]
[drain.beside]
low = [0.26, -0.05, -0.02]
high = [0.29, 0.05, 0.04]
[solid.tank]
shape = "basin"
centre = [0.05, 0.0, 0.0]
size = ["22 cm", "4 cm", "12 cm"]
[solid.gate]
shape = "box"
centre = [0.115, 0.0, 0.06]
size = ["3 cm", "4 cm", "12 cm"]
[solid.piston]
shape = "box"
centre = [-0.02, 0.0, 0.06]
size = ["4 cm", "4 cm", "12 cm"]
path = { times = ["0.01 s", "0.13 s"], shift = [[0.0, 0.0, 0.0], ["12 mm", 0.0, 0.0]] }
[solid.rotor]
shape = "cylinder"
centre = [0.06, 0.0, 0.1]
radius = "3 mm"
length = "3 cm"
axis = [1.0, 0.0, 0.0]
path = { times = ["0 s", "1 s"], angle = ["0 deg", "360 deg"], repeat = true }
"""


TRAY = """
schema = 1
[run]
duration = "0.5 s"
fps = 20
[cloth]
size = ["6 cm", "6 cm"]
spacing = "1 cm"
centre = [0.0, 0.0, 0.021]
[solid.tray]
shape = "box"
centre = [0.0, 0.0, 0.01]
size = ["10 cm", "10 cm", "2 cm"]
friction = 0.8
path = { times = ["0.1 s", "0.45 s"], shift = [[0.0, 0.0, 0.0], ["3 cm", 0.0, "2 cm"]] }
"""


def course(times, shift=None, angle=None, repeat=False) -> Course:
    path = SimpleNamespace(times=times, shift=shift, angle=angle, axis=(0.0, 0.0, 1.0), repeat=repeat)
    return Course(path)


def test_a_path_passes_its_entries_smoothly_and_never_beyond_them():
    shift = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.1, 0.2, 0.0), (0.05, 0.2, 0.0)]
    made = course((1.0, 2.0, 2.5, 4.0), shift)
    for t, entry in zip(made.times, shift):
        assert made.place(t)[0] == pytest.approx(entry)
    t = np.linspace(0.0, 5.0, 50001)
    x = np.array([made.place(a)[0] for a in t])
    v = np.diff(x, axis=0) / np.diff(t)[:, None]
    assert x.min() >= 0.0 and x[:, 0].max() <= 0.1 and x[:, 1].max() <= 0.2
    assert not v[t[1:] < 1.0].any() and not v[t[:-1] > 4.0].any()
    assert np.abs(np.diff(v, axis=0)).max() < 1e-3 * np.abs(v).max()
    assert np.linalg.norm(v, axis=1).max() == pytest.approx(made.fastest(0.0), rel=0.02)


def test_a_path_that_repeats_goes_round_evenly():
    made = course((0.0, 2.0), angle=(0.0, np.pi), repeat=True)
    for t in (0.3, 2.0, 2.5, 7.0):
        assert made.place(t)[1] == pytest.approx(0.5 * np.pi * t)
    assert made.top_speed(6.9, 7.1, 0.2) == pytest.approx(0.1 * np.pi)


@pytest.mark.parametrize(
    "change, words",
    [
        ("solid.piston.path.times=[0.0]", "times must be two or more"),
        ("solid.piston.path.times=[0.3, 0.1]", "each later than the one before"),
        ("solid.piston.path.shift=[[0, 0, 0]]", "shift has 1 entries for 2 times"),
        ('solid.piston.path.shift=[[0, 0, 0], ["1 s", 0, 0]]', "needs a length"),
        ("solid.piston.path.repeat=true", "repeat needs a shift that ends where it began"),
        ("solid.rotor.axis=[0, 0, 0]", "must not be the zero vector"),
        ("solid.rotor.shape=mesh", "solid.rotor.file: missing"),
        ("solid.rotor.radius=-1", "must lie in (0, 1e+06]"),
    ],
)
def test_wrong_solids_are_told_in_a_line(scene_file, change, words):
    from sim import config

    with pytest.raises(ConfigError) as told:
        config.load(scene_file(BUSY), [change])
    assert words in str(told.value) and "\n" not in str(told.value)


def _busy(path: str) -> dict:
    import taichi as ti

    world = open_world(path)
    piston = next(p for p in world.scene.solids.primitives if p.solid == "piston")
    population, unit = world.build.parts["population"], world.scene.water.units
    inside, closed, middle, frames = [], [], None, []
    for _ in range(world.frame_count):
        frames.append(world.advance())
        free = int(population.units.to_numpy()[: world.state.count[None]].sum())
        closed.append(population.emitted_units() == free + population.drained_units())
        x, v = (world.state[f"fluid.{n}"].to_numpy()[: world.state.count[None]].astype(float) for n in "xv")
        face = piston.place(world.clock.time)[0][0] + 0.02
        held = x[:, 0] < 0.1
        inside.append((int(held.sum()), (x[held, 0].min() - face) / 0.004))
        if world.clock.frame == 4:
            middle = world.save()
            near = held & (x[:, 0] < face + 0.006)
            dense = world.state["fluid.density"].to_numpy()[: world.state.count[None]][held].max()
            push = (v[near, 0].mean(), piston.motion(world.clock.time - 1e-3, world.clock.time)[0][0])
    end = world.state_hash()
    world.load(middle)
    while world.frame_index < world.frame_count:
        world.advance()
    streams = [(s.emitted(world.clock.time), s.total) for s in world.scene.water.streams]
    return {
        "inside": np.array(inside),
        "closed": closed,
        "push": push,
        "dense": dense,
        "streams": streams,
        "emitted": population.emitted_units() / unit - len(world.scene.water.x),
        "drained": population.drained_units() / unit,
        "same": world.state_hash() == end,
        "moved": np.ptp([f.solid_x for f in frames], axis=0).max(1),
        "rates": _rates(world, ti),
    }


def _rates(world, ti) -> np.ndarray:
    """(d/dt of the solids' share at points at rest while piston and rotor move, what `rate` says of it)."""
    walls, bodies = world.build.parts["walls"], world.build.parts["bodies"]
    points = ti.Vector.field(3, float, shape=300)
    out = ti.Vector.field(2, float, shape=300)

    @ti.kernel
    def measure():
        for k in range(300):
            share, _, _, swept, _ = walls.fill(points[k])
            out[k] = ti.Vector([share, swept])

    x = np.random.default_rng(1).uniform([0.0, -0.02, 0.0], [0.03, 0.02, 0.03], (300, 3))
    points.from_numpy(x.astype(np.float32))
    found = []
    for t in (0.0699, 0.0701, 0.07):
        world.clock.frame, world.clock.elapsed = 0, t
        bodies.start(1e-4)
        measure()
        found.append(out.to_numpy().astype(float))
    return np.stack([(found[1][:, 0] - found[0][:, 0]) / 2e-4, found[2][:, 1]], 1)


@pytest.fixture(scope="module")
def busy(tmp_path_factory):
    """A piston that pushes a pool, a rotor over it, and beside it two streams that end in two drains."""
    path = tmp_path_factory.mktemp("busy") / "scene.toml"
    path.write_text(BUSY)
    return spawn(_busy, str(path))


def test_a_piston_pushes_and_lets_nothing_past(busy):
    count, gap = busy["inside"].T
    assert (count == 25 * 10 * 8).all()
    assert gap.min() > 0.1
    water, piston = busy["push"]
    assert water == pytest.approx(piston, rel=0.15)
    assert busy["dense"] < 1100.0


def test_moving_walls_compress_at_the_rate_that_they_sweep(busy):
    """By the chain rule: what a wall does to the density of water at rest is -u . grad of its share."""
    seen, told = busy["rates"].T
    assert np.abs(seen).max() > 50.0
    assert -told == pytest.approx(seen, abs=0.02 * np.abs(seen).max())


def test_what_moves_is_drawn_where_it_is(busy):
    moved = busy["moved"]
    assert (moved == 0.0).sum() == 5 * 8 + 8
    assert moved.max() == pytest.approx(0.012, rel=0.1)


def test_two_streams_and_two_drains_keep_their_books(busy):
    """More is drained than either stream brought, so both drains swallow."""
    assert all(busy["closed"])
    assert all(come == total for come, total in busy["streams"])
    assert busy["emitted"] == sum(total for _, total in busy["streams"])
    most = max(total for _, total in busy["streams"])
    assert most < busy["drained"] <= busy["emitted"]


def test_a_moving_scene_goes_on_with_the_same_bits(busy):
    assert busy["same"]


def _tray(path: str) -> tuple[np.ndarray, float]:
    world = open_world(path)
    start = world.state["cloth.x"].to_numpy()
    for _ in range(world.frame_count):
        world.advance()
    moved = world.state["cloth.x"].to_numpy().astype(float) - start
    speed = world.state["cloth.v"].to_numpy()
    return moved.mean(0), float(np.abs(speed).max())


def test_a_tray_carries_the_cloth_that_lies_on_it(tmp_path):
    """Its acceleration, 6 x 3 cm/(0.35 s)^2 = 1.5 m/s^2 at most, is within what friction gives."""
    path = tmp_path / "scene.toml"
    path.write_text(TRAY)
    moved, speed = spawn(_tray, str(path))
    assert moved[0] == pytest.approx(0.03, abs=0.003)
    assert moved[2] == pytest.approx(0.02, abs=0.0015)
    assert speed < 0.05
