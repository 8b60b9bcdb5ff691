"""The bench: the same lattice as the rival's, a fair measure of density, honest times, plain words without a rival."""

import csv
import json
import sys

import numpy as np
import pytest

import main as seep
from sim import config, registry
from sim.scene.build import build_scene
from sim.studies import bench, compression, rival, stopwatch
from tests.spawned import open_world, spawn

STUB = f"""#!{sys.executable}
import json, sys
import numpy as np
order = json.load(open(sys.argv[2]))
if order["method"] != "dfsph":
    sys.exit("no such method here")
steps = [[0.005, 0.005, 9.0, 9.0, 2, 1]] + [[0.005 * k, 0.005, 0.1, 0.2, 4, 1] for k in range(2, 61)]
np.savez(order["positions"], **{{"0.100": np.zeros((1, 3))}})
found = {{"count": order["count"], "steps": steps, "samples": [[0.1, 1e-3, 1.01, 30.0]], "memory": 1e6,
    "solves": ["divergence", "density"]}}
json.dump(found, open(order["figures"], "w"))
print("Time sum: SimStep: 600 ms\\nTime sum: neighborhood_search: 450.5 ms")
"""
"""A rival that takes 20 s per simulated second, after a first step that must not count."""


@pytest.fixture
def stub(tmp_path, monkeypatch):
    path = tmp_path / "python"
    path.write_text(STUB)
    path.chmod(0o755)
    monkeypatch.setenv("SEEP_PEERS", str(path))
    return str(path)


@pytest.fixture(scope="module", autouse=True)
def _methods():
    registry.discover()


@pytest.mark.parametrize(("side", "first"), [(26, (-1.912963, -0.462963, 0.087037)), (38, None)])
def test_block_stands_where_the_rival_puts_it(side, first):
    scene = config.load(bench.SCENE, bench.Duel("dfsph", side, 1.0).overrides())
    x = build_scene(scene).water.x
    assert len(x) == side**3
    if first:  # as pySPlisHSPlasH 2.19 reports it
        assert np.abs(x.min(0) - first).max() < 1e-6
    assert np.allclose(x.max(0) - x.min(0), (side - 1) / (side + 1))


def test_order_is_the_scene_in_numbers():
    order = bench.orders(bench.Duel("wcsph", 26, 0.5, 5e-4), threads=2)
    assert order["stiffness"] == pytest.approx(5e4, rel=1e-6)
    assert (order["dt_max"], order["density_error"], order["cfl"]) == (5e-4, 5e-4, 0.4)
    assert json.loads(json.dumps(order))["tank"] == [4.0, 1.5, 3.0]


def test_densities_are_those_of_a_sum_over_all_pairs():
    x = np.random.default_rng(3).uniform(0.0, 1.0, (300, 3))
    h = compression.SUPPORT * 0.1
    q = np.linalg.norm(x[:, None] - x[None], axis=2) / h
    whole = (np.maximum(1.0 - q, 0.0) ** 4 * (1.0 + 4.0 * q)).sum(1) * 21.0 / (2.0 * np.pi) * (0.1 / h) ** 3
    far = (-9.0,) * 3, (9.0,) * 3
    assert np.allclose(compression.densities(x, 0.1, *far), whole / compression.LATTICE, rtol=1e-12)


@pytest.mark.parametrize("squeeze", [1.0, 0.99])
def test_lattice_has_density_one_and_a_squeezed_one_more(squeeze):
    axis = (np.arange(14) + 0.5) * 0.1
    x = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3) * squeeze
    density = compression.densities(x, 0.1, (0.0,) * 3, (1.4 * squeeze,) * 3)
    assert np.allclose(density, squeeze**-3, rtol=2e-3)  # walls, edges and corners included


def _stepped() -> tuple[str, str, dict]:
    """State after two frames, by World.advance and by the bench's watch; the watch's figures."""
    duel = bench.Duel("dfsph", 5, 0.2)
    world = open_world(bench.SCENE, *duel.overrides())
    start = world.save()
    for _ in range(2):
        world.advance()
    plain = world.state_hash()
    world.load(start)
    watch = stopwatch.Watch(world, bench.orders(duel, 2))
    while world.clock.time < 0.2 - 1e-9:
        watch.step()
    return plain, world.state_hash(), watch.figures()


def test_watch_steps_as_a_run_does_and_loses_no_time():
    plain, watched, figures = spawn(_stepped)
    assert plain == watched
    steps = np.array(figures["steps"])
    assert steps[:, 1].sum() == pytest.approx(0.2)
    assert sum(figures["stages"].values()) == pytest.approx(steps[:, 2].sum(), rel=1e-6)
    assert steps[:, 4].min() >= 1
    assert len(figures["samples"]) == 11 and sorted(figures["positions"]) == ["0.000", "0.100", "0.200"]


def test_table_has_both_sides(stub, tmp_path, capsys):
    assert seep.main(["bench", "--quick", "--out", str(tmp_path / "out")]) == 0
    row = next(csv.DictReader((tmp_path / "out" / "bench.csv").open()))
    assert list(row)[:7] == ["case", "size", "ours", "rival", "ratio", "our_error", "rival_error"]
    assert float(row["rival"]) == pytest.approx(20.0) and float(row["rival_cpu_s_per_s"]) == pytest.approx(40.0)
    assert float(row["ratio"]) == pytest.approx(float(row["ours"]) / 20.0, rel=1e-4)
    assert 0.0 < float(row["our_error"]) < 2e-3 and row["rival_error"] == "0.001"
    assert 15 < float(row["our_neighbours"]) < 40
    stages = list(csv.DictReader((tmp_path / "out" / "stages.csv").open()))
    ours, theirs = ({s["stage"]: float(s["ns"]) for s in stages if s["side"] == side} for side in ("ours", "rival"))
    assert sum(ours.values()) == pytest.approx(float(row["our_ns"]), rel=0.2)
    assert theirs["neighborhood_search"] / theirs["the rest"] == pytest.approx(450.5 / 149.5, rel=1e-4)
    assert "ratio" in capsys.readouterr().out


def test_rival_that_fails_is_told_in_a_line(stub, tmp_path):
    order = bench.orders(bench.Duel("wcsph", 5, 0.1), 1)
    with pytest.raises(rival.NoRival, match="wcsph_125 ended with 1: no such method here"):
        rival.run(stub, order, tmp_path)


def test_row_without_a_rival_has_empty_cells(tmp_path):
    order = bench.orders(bench.Duel("dfsph", 5, 0.1), 1)
    one = {
        "count": 125,
        "memory": 1.0,
        "solves": ["way"],
        "positions": {"0.100": np.zeros((1, 3))},
    }
    one["samples"] = [[0.1, 0.0, 1.0, 30.0]]
    one["steps"] = [[0.05, 0.05, 1.0, 1.0, 1, 1], [0.1, 0.05, 1.0, 1.0, 1, 1]]
    row = bench._row(order, [one], [])
    assert row["ours"] == 20.0 and row["rival"] is row["ratio"] is row["rival_error"] is row["rival_ns"] is None


def test_no_rival_says_how_to_get_one(monkeypatch, tmp_path):
    monkeypatch.delenv("SEEP_PEERS", raising=False)
    monkeypatch.setattr(rival, "ROOT", tmp_path)
    with pytest.raises(rival.NoRival, match="make bench"):
        rival.interpreter()


def test_wrong_words_are_refused(monkeypatch, capsys):
    assert seep.main(["bench", "dfhsp"]) == 2
    assert "no such case; choose from dfsph_17576, dfsph_54872, wcsph_17576" in capsys.readouterr().err
    monkeypatch.setenv("SEEP_PEERS", "/nowhere/python")
    assert seep.main(["bench", "--quick"]) == 2
    assert "SEEP_PEERS = /nowhere/python: must be a Python" in capsys.readouterr().err


SHEET_STUB = f"""#!{sys.executable}
import json, sys
import numpy as np
order = json.load(open(sys.argv[2]))
assert sys.argv[1].endswith("positionbased.py")
n = order["nodes"]
x = np.zeros((5, n * n, 3))
x[..., 0], x[..., 2] = 1.02 * order["spacing"] * (np.arange(n * n) % n), order["spacing"] * (np.arange(n * n) // n)
np.savez(order["positions"], x=x)
found = {{"steps": [[0.5, 0.5]] * 50, "constraints": 58806, "springs": 29601, "memory": 1e6}}
json.dump(found, open(order["figures"], "w"))
"""
"""A sheet stretched by 2 % along, by none down, in 100 s per simulated second."""


def test_a_sheet_is_timed_beside_the_rivals(tmp_path):
    from sim.studies import bench_cloth

    path = tmp_path / "python"
    path.write_text(SHEET_STUB)
    path.chmod(0o755)
    order = bench_cloth.order(0.25, 1)
    assert (order["nodes"], order["substeps"], order["stiffness"], order["held"]) == (100, 5, 1500.0, [9900, 9999])
    assert sum(order["mass"]) == pytest.approx(0.15 * 0.99**2)
    theirs = bench_cloth._sum_up(rival.run(str(path), order, tmp_path, bench_cloth.SCRIPT), order)
    assert theirs["error"] == pytest.approx(0.01) and theirs["s_per_s"] == pytest.approx(100.0)
    row = bench_cloth._row(order, [theirs | {"s_per_s": 2.0, "cpu_s_per_s": 1.0}], [theirs])
    assert row["ratio"] == pytest.approx(0.02) and row["cpu_ratio"] == pytest.approx(0.01)
    assert "ratio 0.020, of CPU 0.010" in bench_cloth._words(row)
