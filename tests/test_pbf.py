"""Position based fluids: as soft as they say, calm at rest, momentum kept, the same bits on any number of threads."""

import numpy as np
import pytest

from tests.spawned import open_world, spawn
from tests.test_fluid import DROP, POUR, TANK, _drop, _pour, _row, _scene


def _rest(path: str) -> dict:
    world = open_world(path, "fluid.method=pbf", "run.duration=0.8")
    pressure, rest = world.build.parts["pressure"], world.config.fluid.liquid.rest_density
    weight = _row(world, "mass").sum() * 9.81
    speeds, forces, squeezed = [], [], []
    for frame in range(world.frame_count):
        world.advance()
        if frame < 8:
            continue
        z, rho, kappa = _row(world, "x")[:, 2], _row(world, "density"), _row(world, "pbf.kappa")
        speeds.append(np.sqrt((_row(world, "v") ** 2).sum(1).mean()))
        forces.append(-(_row(world, "mass") * kappa * _row(world, "walls.gradient")[:, 2]).sum() / weight)
        inside = (z > 0.006) & (z < 0.017)
        squeezed.append(np.polyfit(z[inside], (rho / rest - 1.0)[inside], 1)[0])
    dt = world.ledger_row()["dt"]
    return {
        "speed": np.mean(speeds),
        "force": np.mean(forces),
        "slope": np.mean(squeezed),
        "told": -pressure.params.compression / 0.025 * (dt / pressure.softest) ** 2,
        "bound": world.clock.bound.name,
        "count": world.state.count[None],
    }


@pytest.fixture(scope="module")
def rest(tmp_path_factory):
    """The tank of 1,440 particles, 10 deep."""
    return spawn(_rest, _scene(tmp_path_factory, TANK))


def test_still_water_is_calm_and_its_floor_carries_it(rest):
    assert rest["count"] == 1440
    assert rest["speed"] < 0.01
    assert rest["force"] == pytest.approx(1.0, abs=0.005)


def test_water_gives_way_by_as_much_as_the_step_lets_it(rest):
    """d(rho/rho0)/dz = -g/c^2, c = (dx/dt) sqrt(n/L)."""
    assert rest["slope"] == pytest.approx(rest["told"], rel=0.25)
    assert rest["bound"] in ("softness", "run.dt_max")


def _free(path: str) -> np.ndarray:
    return _drop(path)["seen"]


def test_a_free_drop_keeps_its_momentum_to_rounding(tmp_path_factory):
    seen = spawn(_free, _scene(tmp_path_factory, DROP.replace("[fluid]", '[fluid]\nmethod = "pbf"')))
    assert np.abs(seen[:, :3] - seen[0, :3]).max() < 1e-5 * 0.064 * 0.5
    assert (np.diff(seen[:, 3]) < 1e-9).all()


def test_a_jet_is_the_same_on_one_thread_and_on_two(tmp_path_factory):
    text = POUR.replace("[fluid]", '[fluid]\nmethod = "pbf"').replace('"0.4 s"', '"0.3 s"')
    one, two = (spawn(_pour, _scene(tmp_path_factory, text), threads) for threads in (1, 2))
    assert all(one["closed"]) and one["emitted"] > 300
    assert [name for name in one["rows"] if one["rows"][name] != two["rows"][name]] == []
