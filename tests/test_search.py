"""Searches against brute force: the same pairs as sets, and the same lists where rows stand in the same order."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.spawned import spawn

RADIUS = 0.1
SPACE = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
PERIODIC = {
    "zx, two radii thick": ((-1.0, -1.0, -0.1), (1.0, 1.0, 0.1001)),
    "xyz, three cells": ((-0.16, -0.15, -0.17), (0.16, 0.16, 0.16)),
}
"""By name, of which the letters before a comma are the axes: what the points are wrapped into."""
CAPACITY = 1500


def _points(axes: tuple = (), space: tuple = SPACE) -> dict[str, np.ndarray]:
    """Wrapped into space along its periodic axes, as the move leaves them."""
    low, size = np.array(space[0]), np.array(space[1]) - space[0]
    ring = np.isin(list("xyz"), axes)
    return {name: np.where(ring, low + (x - low) % size, x) for name, x in _scattered().items()}


def _scattered() -> dict[str, np.ndarray]:
    random = np.random.default_rng(7)
    lost = random.uniform(-0.3, 0.3, (400, 3))
    lost[[3, 77, 78], [0, 1, 1]], lost[5] = np.nan, -np.nan
    lattice = np.stack(np.meshgrid(*[np.arange(8) * 0.05] * 3), -1).reshape(-1, 3)
    return {
        "random": random.uniform(-1.0, 1.0, (1500, 3)),
        "clustered": random.normal(0.0, 0.06, (1200, 3)) + 0.8,
        "coincident": np.repeat(random.uniform(-0.5, 0.5, (2, 3)), 300, 0),
        "lattice": lattice,
        "long in x": random.uniform(-1.0, 1.0, (900, 3)) * [1.0, 0.3, 0.2],
        "long in y": random.uniform(-1.0, 1.0, (900, 3)) * [0.2, 1.0, 0.3],
        "plane": random.uniform(-1.0, 1.0, (800, 3)) * [1.0, 1.0, 0.0],
        "empty": np.zeros((0, 3)),
        "single": np.array([[0.2, -0.3, 0.9]]),
        "pair": np.array([[0.0, 0.0, 0.0], [0.0999, 0.0, 0.0]]),
        "lost": lost,
        "outside": random.uniform(0.9, 1.3, (900, 3)) * random.choice([-1.0, 1.0], (900, 3)),
    }


def _split(search, state) -> bool:
    """Whether `middle` parts what lies before a row from what lies behind it."""
    count = state.count[None]
    start, middle, stop = (f.to_numpy()[:count] for f in (search.list.start, search.list.middle, search.list.stop))
    rows = search.list.neighbour.to_numpy()
    ends = enumerate(zip(start, middle, stop))
    return all((rows[a:b] < i).all() and (rows[b:c] > i).all() for i, (a, b, c) in ends)


def _listed(search, state) -> list[np.ndarray]:
    count = state.count[None]
    start, stop = (f.to_numpy()[:count] for f in (search.list.start, search.list.stop))
    neighbour = search.list.neighbour.to_numpy()
    return [neighbour[a:b].copy() for a, b in zip(start, stop)]


def _compare(axes: tuple = (), space: tuple = SPACE, much: bool = False) -> dict:
    """Both searches on all points; `much`: as they would search among many thousands."""
    from sim import registry, runtime
    from sim.stage import Build
    from sim.state import ROWS, State

    runtime.start(threads=2)
    runtime.many = lambda particles, sheet: much
    registry.discover()
    grid_class, brute_class = (registry.method("search", name) for name in ("grid", "brute"))
    fluid = SimpleNamespace(support_radius=RADIUS, support=1.5)
    config = SimpleNamespace(fluid=fluid, cloth=None, space=SimpleNamespace(low=space[0], high=space[1], periodic=axes))
    state = State([ROWS["fluid.id"], ROWS["fluid.x"], *grid_class.scratch], {"fluid": CAPACITY})
    grid, brute = (cls(Build(config, None, state), cls.Params()) for cls in (grid_class, brute_class))
    found = {}
    for name, points in _points(axes, space).items():
        whole = np.zeros((CAPACITY, 3), np.float32)
        whole[: len(points)] = points
        state["fluid.x"].from_numpy(whole)
        state["fluid.id"].from_numpy(np.arange(CAPACITY, dtype=np.int32))
        state.count[None] = len(points)
        grid.build()
        brute.build()
        ids = state["fluid.id"].to_numpy()[: len(points)]
        moved = state["fluid.x"].to_numpy()[: len(points)]
        found[name] = {
            "grid": _listed(grid, state),
            "brute": _listed(brute, state),
            "kept": bool(
                (np.sort(ids) == np.arange(len(points))).all() and np.array_equal(moved, whole[ids], equal_nan=True)
            ),
            "room": grid.list.room,
            "split": _split(grid, state) and _split(brute, state),
        }
    return found


@pytest.fixture(scope="module", params=[False, True], ids=["few", "many"])
def found(request):
    return spawn(_compare, much=request.param)


@pytest.mark.parametrize("name", list(_points()))
def test_grid_lists_what_brute_force_lists(found, name):
    grid, brute = found[name]["grid"], found[name]["brute"]
    assert len(grid) == len(_points()[name])
    assert all(np.array_equal(a, b) for a, b in zip(grid, brute))


@pytest.mark.parametrize("name", list(_points()))
def test_middle_parts_a_row_where_it_stands_itself(found, name):
    assert found[name]["split"]


@pytest.mark.parametrize("name", list(_points()))
def test_sorting_loses_and_changes_no_row(found, name):
    assert found[name]["kept"]


@pytest.mark.parametrize("name", ["random", "outside", "coincident"])
def test_pairs_are_mutual_and_none_is_its_own(found, name):
    pairs = {(i, int(j)) for i, row in enumerate(found[name]["grid"]) for j in row}
    assert pairs == {(j, i) for i, j in pairs}
    assert all(i != j for i, j in pairs)


def test_coincident_points_outgrow_the_first_list_and_all_are_kept(found):
    assert all(len(row) >= 299 for row in found["coincident"]["grid"])
    assert found["coincident"]["room"] >= 299


def test_numpy_agrees_on_random_points(found):
    points = _points()["random"].astype(np.float32)
    near = (np.linalg.norm(points[:, None] - points[None], axis=-1) < RADIUS).sum() - len(points)
    assert sum(len(row) for row in found["random"]["brute"]) == near


@pytest.fixture(scope="module", params=PERIODIC)
def wrapped(request):
    axes = tuple(request.param.split(",")[0])
    return axes, PERIODIC[request.param], spawn(_compare, axes, PERIODIC[request.param])


def test_on_a_ring_grid_lists_what_brute_force_lists(wrapped):
    for name, lists in wrapped[2].items():
        assert len(lists["grid"]) == len(_points()[name])
        assert all(np.array_equal(a, b) for a, b in zip(lists["grid"], lists["brute"])), name


def test_numpy_agrees_on_a_ring(wrapped):
    axes, (low, high), found = wrapped
    points = _points(axes, (low, high))["random"].astype(np.float32)
    r = points[:, None] - points[None]
    plain = (np.linalg.norm(r, axis=-1) < RADIUS).sum() - len(points)
    for a in ("xyz".index(a) for a in axes):
        length = high[a] - low[a]
        r[..., a] -= length * np.round(r[..., a] / length)
    near = (np.linalg.norm(r, axis=-1) < RADIUS).sum() - len(points)
    assert sum(len(row) for row in found["random"]["brute"]) == pytest.approx(near, rel=1e-4)
    assert near > plain
