"""The pressure solve of much water, each pair once: the same water as with all pairs of each row, and the same bits."""

import numpy as np
import pytest
from spawned import open_world, spawn

SCENE = """
schema = 1
[run]
duration = "0.1 s"
fps = 50
dt_max = "1 ms"
[space]
gravity = [0.0, 0.0, {gravity}]
low = [-0.2, -0.2, -0.2]
high = [0.2, 0.2, 0.2]
[fluid]
spacing = "4 mm"
terms = []
[fluid.dfsph]
density_error = 1e-5
divergence_error = 1e-4
[fluid.liquid]
rest_density = 1000.0
nu = 0.0
surface_tension = 0.0
"""
HALVES = """
[fluid.block.front]
low = [-0.032, -0.02, -0.032]
high = [0.0, 0.04, 0.032]
velocity = [0.2, 0.1, 0.0]
[fluid.block.back]
low = [0.0, -0.04, -0.032]
high = [0.032, 0.02, 0.032]
velocity = [-0.2, 0.0, 0.05]
"""
COLUMN = """
[fluid.block.column]
low = [-0.1, -0.03, 0.0]
high = [-0.04, 0.03, 0.1]
[solid.tank]
shape = "basin"
size = [0.2, 0.06, 0.1]
thickness = "8 mm"
"""
FEW = """
[fluid.block.crumb]
low = [0.0, 0.0, 0.0]
high = [0.012, 0.012, 0.004]
"""
SCENES = {"halves": (0.0, HALVES), "column": (-9.81, COLUMN), "crumb": (0.0, FEW)}
STEPS = 30


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mutual")
    for name, (gravity, rest) in SCENES.items():
        (folder / f"{name}.toml").write_text(SCENE.format(gravity=gravity) + rest)
    return folder


def solve(path, much, precision="f64", threads=1, far=4.0):
    """Water after some steps, solved as much water is or as little is, however much there is; rows by place."""
    from sim import runtime
    from sim.fluid import mutual

    mutual.FAR = far
    runtime.many = lambda particles, sheet: much
    world = open_world(str(path), precision=precision, threads=threads)
    found = {"spin": [spin(world)]}
    for _ in range(STEPS):
        world.step()
    found["spin"].append(spin(world))
    if much:
        found |= pairs(world)
    count = world.state.count[None]
    x, v = (world.state[f"fluid.{name}"].to_numpy()[:count] for name in "xv")
    order = np.lexsort(np.round(x / 1e-4).T)
    found |= {"x": x[order], "v": v[order], "iterations": world.iterations, "hash": world.state_hash()}
    return found | {"speed": float(np.abs(v).max()), "spacing": world.config.fluid.spacing}


def spin(world):
    """Linear and angular momentum, and what they are small beside."""
    count = world.state.count[None]
    x, v, m = (world.state[f"fluid.{name}"].to_numpy()[:count].astype(np.float64) for name in ("x", "v", "mass"))
    turn = m[:, None] * np.cross(x, v)
    return np.array([*(m[:, None] * v).sum(0), *turn.sum(0)]), np.array(
        [np.abs(m[:, None] * v).sum(), np.abs(turn).sum()]
    )


def pairs(world):
    """The last step's pairs as the list of neighbours has them, and as the solve has them; its chunks."""
    solver, lists = world.build.parts["pressure"].projection, world.build.parts["pairs"]
    count = world.state.count[None]
    start, stop, neighbour, slope = (f.to_numpy() for f in (lists.start, lists.stop, lists.neighbour, lists.slope))
    own = solver.lists()
    first, near, pull = own.start.to_numpy(), own.near.to_numpy(), own.pull.to_numpy()
    asked = [(i, neighbour[k], slope[k]) for i in range(count) for k in range(start[i], stop[i]) if neighbour[k] > i]
    rows = [(i, slice(first[i], first[i + 1])) for i in range(count)]
    given = [(i, j, f) for i, fours in rows for j, f in zip(near[fours].ravel(), pull[fours].ravel())]
    idle = [pair for pair in given if pair[0] == pair[1]]
    given = [pair for pair in given if pair[0] != pair[1]]
    bound = solver.bound.to_numpy()[: solver.chunks[None] + 1]
    chunk = np.searchsorted(bound, np.array(given)[:, :2], side="right") - 1
    mass = world.state["fluid.mass"].to_numpy()
    return {
        "asked": sorted((i, j) for i, j, _ in asked),
        "given": sorted((i, j) for i, j, _ in given),
        "pulls": np.abs([a[2] * mass[a[0]] - b[2] for a, b in zip(sorted(asked), sorted(given))]).max(),
        "largest": max(abs(pair[2]) for pair in given),
        "idle": all(pair[2] == 0.0 for pair in idle),
        "farthest": int((chunk[:, 1] - chunk[:, 0]).max()),
        "chunks": bound,
    }


@pytest.fixture(scope="module", params=[*SCENES])
def both(request, folder):
    path = folder / f"{request.param}.toml"
    return spawn(solve, path, True), spawn(solve, path, False), request.param


def test_water_goes_where_all_pairs_of_each_row_would_send_it(both):
    much, little, _ = both
    assert abs(much["iterations"] - little["iterations"]) <= 2
    assert np.abs(much["x"] - little["x"]).max() < 1e-7 * much["spacing"]
    assert np.abs(much["v"] - little["v"]).max() <= 1e-7 * much["speed"]


def test_each_pair_is_there_once_and_chunks_hold_it(both):
    much, _, scene = both
    assert much["asked"] == much["given"] and much["idle"]
    assert much["pulls"] < 1e-12 * much["largest"]
    assert much["farthest"] <= 1
    chunks = much["chunks"]
    assert chunks[0] == 0 and (np.diff(chunks) > 0).all() and chunks[-1] == len(much["x"])
    assert len(chunks) == 2 if scene == "crumb" else len(chunks) > 4


def test_momentum_and_spin_of_free_water_stay(both):
    much, _, scene = both
    (before, size), (after, _) = much["spin"]
    if scene == "halves":
        assert np.abs(after - before)[:3].max() < 1e-13 * size[0]
        assert np.abs(after - before)[3:].max() < 1e-13 * size[1]


def test_the_bits_are_the_same_on_any_number_of_threads_and_however_early_pushes_are_begun(folder):
    """Never, where another iteration is sure, or always, and forgotten when none follows."""
    path = folder / "column.toml"
    runs = ((1, 4.0), (2, 4.0), (5, 4.0), (1, 0.0), (1, 1e9))
    found = {spawn(solve, path, True, precision="f32", threads=threads, far=far)["hash"] for threads, far in runs}
    assert len(found) == 1
