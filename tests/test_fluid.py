"""Water alone: at rest, in free flight, breaking a dam, poured and drained; a scene runs once, in its own process."""

import numpy as np
import pytest

from tests.spawned import open_world, spawn

TANK = """
schema = 1
[run]
duration = "1.2 s"
fps = 20
[space]
low = [-0.05, -0.05, -0.05]
high = [0.05, 0.05, 0.1]
[fluid]
spacing = "2.5 mm"
[fluid.block.water]
low = [-0.015, -0.015, 0.0]
high = [0.015, 0.015, 0.025]
[solid.tank]
shape = "basin"
size = ["3 cm", "3 cm", "5 cm"]
"""

DROP = """
schema = 1
[run]
duration = "0.1 s"
fps = 50
[space]
gravity = [0.0, 0.0, 0.0]
low = [-0.1, -0.1, -0.1]
high = [0.1, 0.1, 0.1]
[fluid]
spacing = "4 mm"
[fluid.liquid]
rest_density = 1000.0
nu = "1e-3 m^2/s"
surface_tension = 0.0
[fluid.block.front]
low = [-0.02, -0.02, -0.02]
high = [0.0, 0.02, 0.02]
velocity = [0.5, 0.1, 0.0]
[fluid.block.back]
low = [0.0, -0.02, -0.02]
high = [0.02, 0.02, 0.02]
velocity = [-0.3, 0.0, 0.2]
"""

DAM = """
schema = 1
[run]
duration = "0.22 s"
fps = 100
[space]
low = [-0.02, -0.02, -0.02]
high = [0.8, 0.1, 0.4]
[fluid]
spacing = "1 cm"
method = "METHOD"
[fluid.wcsph]
sound_speed = "20 m/s"
[fluid.block.column]
low = [0.0, 0.0, 0.0]
high = [0.1, 0.06, 0.2]
[solid.flume]
shape = "basin"
centre = [0.35, 0.03, 0.0]
size = [0.7, 0.06, 0.4]
"""

POUR = """
schema = 1
[run]
duration = "0.4 s"
fps = 20
[space]
low = [-0.05, -0.05, -0.03]
high = [0.05, 0.05, 0.1]
[fluid]
spacing = "3 mm"
[emitter.spout]
centre = [0.0, 0.0, 0.07]
speed = "0.8 m/s"
rate = "60 ml/s"
start = "0.05 s"
stop = "0.35 s"
[solid.floor]
shape = "box"
centre = [0.0, 0.0, -0.002]
size = ["4 cm", "4 cm", "4 mm"]
[drain.plug]
low = [-0.03, -0.03, -0.03]
high = [0.03, 0.03, -0.015]
"""


def _scene(folder, text: str) -> str:
    path = folder.mktemp("water") / "scene.toml"
    path.write_text(text)
    return str(path)


def _row(world, name: str) -> np.ndarray:
    return world.state[f"fluid.{name}"].to_numpy()[: world.state.count[None]].astype(float)


def _step(world) -> None:
    dt = world.clock.next_step(world.stages)
    for stage in world.stages:
        stage.run(dt)
    world.clock.advance(dt)


def _tank(path: str) -> dict:
    world = open_world(path)
    speeds, forces, slopes = [], [], []
    weight = _row(world, "mass").sum() * 9.81
    while world.clock.time < 1.2 - 1e-9:
        _step(world)
        v, z, rho = _row(world, "v"), _row(world, "x")[:, 2], _row(world, "density")
        speeds.append((world.clock.time, np.sqrt((v**2).sum(1).mean())))
        if world.clock.time < 0.6:
            continue
        kappa = _row(world, "dfsph.kappa")
        forces.append(-(_row(world, "mass") * kappa * _row(world, "walls.gradient")[:, 2]).sum())
        inside = (z > 0.006) & (z < 0.017)
        slopes.append(np.polyfit(z[inside], (rho**2 * kappa)[inside], 1)[0])
    return {
        "speeds": np.array(speeds),
        "force": np.mean(forces) / weight,
        "slope": np.mean(slopes),
        "density": rho,
        "low": z.min(),
        "count": len(z),
    }


@pytest.fixture(scope="module")
def tank(tmp_path_factory):
    """1,440 particles, 2.5 cm deep."""
    return spawn(_tank, _scene(tmp_path_factory, TANK))


def test_a_still_tank_keeps_its_water_and_its_density(tank):
    assert tank["count"] == 12 * 12 * 10
    assert tank["low"] > 0.0
    assert tank["density"].mean() == pytest.approx(1000.0, rel=0.01)
    assert tank["density"].max() < 1050.0


def test_a_still_tank_stays_calm(tank):
    time, speed = tank["speeds"].T
    assert speed.max() < 0.04
    assert speed[time > 0.9].mean() < 1.5 * speed[(time > 0.2) & (time < 0.5)].mean()


def test_the_floor_carries_the_weight(tank):
    assert tank["force"] == pytest.approx(1.0, abs=0.02)


def test_pressure_grows_with_depth(tank):
    """At support 2 disordered water shows up to 15 % more than rho g: a strain e changes its density by 0.87 e."""
    assert tank["slope"] == pytest.approx(-1000.0 * 9.81, rel=0.15)


def _drop(path: str) -> dict:
    world = open_world(path)
    population = world.build.parts["population"]
    units = population.units.to_numpy()
    count = world.state.count[None]
    units[:count] = (units[:count] * np.random.default_rng(3).uniform(0.6, 1.0, count)).astype(np.int64)
    population.units.from_numpy(units)
    population.mass.from_numpy((units * 1e-15).astype(np.float32))
    seen = []
    for _ in range(world.frame_count):
        m, v = _row(world, "mass")[:, None], _row(world, "v")
        seen.append([*(m * v).sum(0), 0.5 * (m * v * v).sum()])
        world.advance()
    return {"seen": np.array(seen), "term": _term(world)}


def _term(world) -> dict:
    """Accelerations of a pair by viscosity, as the kernel sees them."""
    import taichi as ti

    motion = world.build.parts["pressure"].motion
    term, state = motion.terms[0], world.state
    out = ti.Vector.field(3, float, shape=3)

    @ti.kernel
    def act(boost: ti.math.vec3, gradient: ti.math.vec3):
        for _ in range(1):
            r = state["fluid.x"][0] - state["fluid.x"][1]
            out[0] = term.acceleration(0, 1, r, gradient)
            out[1] = term.acceleration(1, 0, -r, -gradient)
            state["fluid.v"][0] += boost
            state["fluid.v"][1] += boost
            out[2] = term.acceleration(0, 1, r, gradient)

    act([0.0, 0.0, 0.0], [300.0, -200.0, 100.0])
    pair = out.to_numpy()
    act([1.0, -2.0, 0.5], [300.0, -200.0, 100.0])
    boosted = out.to_numpy()[2]
    act([0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    return {"pair": pair, "boosted": boosted, "beyond": out.to_numpy()}


@pytest.fixture(scope="module")
def drop(tmp_path_factory):
    """Two halves of a thick drop fly into each other, weightless, masses 0.6 to 1 of the whole particle's."""
    return spawn(_drop, _scene(tmp_path_factory, DROP))


def test_a_free_drop_keeps_its_momentum_to_rounding(drop):
    momentum, scale = drop["seen"][:, :3], 0.064 * 0.5
    assert np.abs(momentum - momentum[0]).max() < 1e-5 * scale


def test_a_free_drop_loses_energy_and_never_gains_any(drop):
    energy = drop["seen"][:, 3]
    assert (np.diff(energy) < 1e-9).all()
    assert energy[-1] < 0.7 * energy[0]


def test_viscosity_is_mutual_galilean_and_ends_with_the_support(drop):
    a, b, _ = drop["term"]["pair"]
    assert np.abs(a).max() > 0.0
    assert np.array_equal(a, -b)
    assert drop["term"]["boosted"] == pytest.approx(a, abs=1e-3 * float(np.abs(a).max()))
    assert not drop["term"]["beyond"].any()


MARTIN_MOYCE = np.array([(1.0, 1.32), (1.5, 1.75), (2.0, 2.35), (2.5, 2.99), (3.0, 3.70)])
"""(T, Z): front Z = x/a at T = t sqrt(2 g/a) of a column twice as high as wide.   Martin & Moyce 1952, Table 2"""


def _dam(path: str) -> dict:
    world = open_world(path)
    times, fronts = [0.0], [1.0]
    for _ in range(world.frame_count):
        world.advance()
        times.append(world.clock.time * np.sqrt(2.0 * 9.81 / 0.1))
        fronts.append((np.sort(_row(world, "x")[:, 0])[-6:].mean() + 0.005) / 0.1)
    return {"times": np.array(times), "fronts": np.array(fronts), "count": world.state.count[None]}


@pytest.mark.parametrize("method", ["dfsph", "pbf", "wcsph"])
def test_a_breaking_dam_runs_as_martin_and_moyce_saw(tmp_path_factory, method):
    """10 particles across the column; one shift 0 <= T0 <= 0.25 stands for the gate's opening."""
    run = spawn(_dam, _scene(tmp_path_factory, DAM.replace("METHOD", method)))
    times, seen = MARTIN_MOYCE.T
    errors = [
        np.sqrt(np.mean((np.interp(times - shift, run["times"], run["fronts"]) / seen - 1.0) ** 2))
        for shift in np.linspace(0.0, 0.25, 26)
    ]
    assert min(errors) < 0.1
    assert run["count"] == 10 * 6 * 20


def _pour(path: str, threads: int) -> dict:
    world = open_world(path, threads=threads)
    population, stream = world.build.parts["population"], world.scene.water.streams[0]
    unit = world.scene.water.units
    closed, due, gaps = [], [], []
    for frame in range(world.frame_count):
        world.advance()
        free = int(population.units.to_numpy()[: world.state.count[None]].sum())
        closed.append(population.emitted_units() == free + population.drained_units())
        before = world.clock.time - 2.5e-3
        due.append((stream.emitted(before), population.emitted_units() / unit, stream.emitted(world.clock.time)))
        x = _row(world, "x")
        if frame == 5:
            z = np.sort(x[x[:, 2] > 0.055][:, 2])
            gaps.append(np.diff(z).max())
    ids = np.sort(world.state["fluid.id"].to_numpy()[: world.state.count[None]])
    return {
        "closed": closed,
        "due": due,
        "gap": max(gaps),
        "emitted": population.emitted_units() / unit,
        "drained": population.drained_units(),
        "distinct": len(np.unique(ids)) == len(ids),
        "rows": {name: array.tobytes() for name, array in world.state.save().items()},
    }


@pytest.fixture(scope="module")
def pours(tmp_path_factory):
    """A jet that splashes on a small table over a drain, on 1 thread and on 2."""
    path = _scene(tmp_path_factory, POUR)
    return [spawn(_pour, path, threads) for threads in (1, 2)]


def test_a_stream_pours_its_rate_times_its_time(pours):
    assert pours[0]["emitted"] == round(60e-6 * 0.3 / 0.003**3)
    assert all(before <= poured <= now for before, poured, now in pours[0]["due"])


def test_a_stream_has_no_gap_between_its_layers(pours):
    assert pours[0]["gap"] < 1.35 * 0.003


def test_what_is_poured_is_free_or_drained_to_the_unit(pours):
    assert all(pours[0]["closed"])
    assert pours[0]["drained"] > 0
    assert pours[0]["distinct"]


def test_one_thread_and_two_leave_the_same_bits(pours):
    one, two = (p["rows"] for p in pours)
    assert one.keys() == two.keys()
    assert [name for name in one if one[name] != two[name]] == []
