"""Searches over boxes: the lists of all are those that NumPy finds, on awkward inputs and after the boxes moved."""

from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest

from sim.studies.search import levels
from tests.spawned import spawn

BOXES, QUERIES = 700, 900
"""Each input is padded to this size by boxes and queries far away, so that one compiled kernel serves all."""
SEARCHES = ("brute", "grid", "bvh", "lbvh")


def _inputs() -> dict[str, tuple[np.ndarray, ...]]:
    """By name: low and high of boxes, low and high of queries, each (n, 3) f32."""
    random = np.random.default_rng(5)

    def around(centre, half):
        return (centre - half).astype(np.float32), (centre + half).astype(np.float32)

    def spread(n, size=1.0):
        return random.uniform(-size, size, (n, 3))

    u = np.stack(np.meshgrid(np.arange(25.0), np.arange(25.0), [0.0], indexing="ij"), -1).reshape(-1, 3) / 12.0 - 1.0
    sheet = u + [[0.0, 0.0, 0.2]] * np.sin(4.0 * u[:, :1])
    crumpled = random.normal(0.0, 0.05, (600, 3))
    far = np.where(np.arange(600)[:, None] == 0, 1e4, spread(600))
    path = spread(600)
    return {
        "random": (*around(spread(600), random.uniform(0.0, 0.1, (600, 3))), *around(spread(800), 0.02)),
        "sheet": (*around(sheet, [0.05, 0.05, 0.01]), *around(spread(800), 0.0)),
        "clustered": (*around(crumpled, 0.01), *around(random.normal(0.0, 0.05, (800, 3)), 0.005)),
        "coincident": (*around(np.zeros((300, 3)), 0.1), *around(np.zeros((300, 3)), 0.0)),
        "points": (*around(np.zeros((300, 3)), 0.0), *around(np.repeat(spread(2, 0.01), 20, 0), 0.02)),
        "flat": (*around(spread(600) * [1, 1, 0], [0.05, 0.05, 0.0]), *around(spread(800) * [1, 1, 0], 0.0)),
        "line": (*around(spread(600) * [1, 0, 0], 0.0), *around(spread(800) * [1, 0, 0], 0.01)),
        "touching": (*around(u, 1.0 / 24.0), *around(u, 1.0 / 24.0)),
        "one far off": (*around(far, 0.03), *around(spread(800), 0.03)),
        "fast": (*around(sheet, 0.05), np.minimum(path, path[::-1]), np.maximum(path, path[::-1])),
        "large and small": (*around(spread(600), 10.0 ** random.uniform(-6, 0, (600, 1))), *around(spread(800), 0.01)),
        "single": (*around(np.zeros((1, 3)), 0.5), *around(spread(800), 0.0)),
        "empty": (*around(np.zeros((0, 3)), 0.0), *around(spread(800), 0.1)),
        "nothing asked": (*around(spread(600), 0.1), *around(np.zeros((0, 3)), 0.0)),
    }


def _expected(low, high, query_low, query_high) -> list[np.ndarray]:
    near = (query_low[:, None] <= high[None]).all(-1) & (low[None] <= query_high[:, None]).all(-1)
    return [np.flatnonzero(row) for row in near]


def _moved(low, high) -> tuple[np.ndarray, np.ndarray]:
    """Sheared, as a sheet that swings; order kept."""
    shift = (0.6 * low[:, [1, 2, 0]] + [0.3, 0.0, -0.1]).astype(np.float32)
    return low + shift, high + shift


def _listed() -> dict[tuple[str, str], list[list[np.ndarray]]]:
    """By input and search: rows after a build, after a refit to boxes that moved, and, where a search can leave boxes
    out, without the odd ones of these."""
    import taichi as ti

    from sim import registry, runtime
    from sim.search.candidates import Candidates

    runtime.start(threads=2)
    registry.discover()
    found = {}
    for name in SEARCHES:
        for size in (BOXES, 1, 0):
            fields = [ti.Vector.field(3, float, shape=max(n, 1)) for n in (size, size, QUERIES, QUERIES)]
            even = ti.field(ti.i32, shape=max(size, 1))
            even.from_numpy(1 - np.arange(max(size, 1), dtype=np.int32) % 2)
            boxes = registry.method("search.boxes", name)(size)
            candidates = Candidates(boxes, *fields[:2], QUERIES)
            for case, (low, high, *queries) in _inputs().items():
                if (size if size < 2 else BOXES) != (len(low) if len(low) < 2 else BOXES):
                    continue
                rows = []
                for turn, (a, b) in enumerate(((low, high), *[_moved(low, high)] * (1 + boxes.leaves_out))):
                    for field, values in zip(fields, (a, b, *queries)):
                        padded = np.full((field.shape[0], 3), 3.0, np.float32)
                        padded[: len(values)] = values
                        field.from_numpy(padded)
                    (boxes.refit if turn else boxes.build)(*fields[:2], *([even] if turn == 2 else []))
                    candidates.find(*fields[2:], len(queries[0]))
                    start, stop, listed = (
                        f.to_numpy() for f in (candidates.list.start, candidates.list.stop, candidates.list.neighbour)
                    )
                    rows.append([listed[s:e].copy() for s, e in zip(start, stop)][: len(queries[0])])
                found[case, name] = rows
            if name == "lbvh" and size == BOXES:
                found["builds"] = _wear(boxes, fields[:2])
    found["levels"] = _levels()
    return found


def _levels() -> dict[str, np.ndarray]:
    """Boxes of the report's tree over a flat sheet of 5 x 4 patches."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "tree.npz"
        x, y = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
        first = (5 * np.arange(5)[:, None] + np.arange(4)).reshape(-1, 1)
        triangles = np.stack([first + [0, 5, 6], first + [0, 6, 1]], 1).reshape(-1, 3)
        frame = SimpleNamespace(cloth_x=np.stack([x, y, 0.0 * x], -1).reshape(-1, 3))
        levels.write(path, frame, SimpleNamespace(cloth_triangles=triangles, cloth_thickness=0.1))
        with np.load(path) as file:
            return dict(file)


def _wear(boxes, fields) -> list[int]:
    """Builds of a tree: after one, after refits to what hardly moves, and after refits to boxes that changed places."""
    low, high = (np.resize(corner, (BOXES, 3)) for corner in _inputs()["sheet"][:2])
    order, builds = np.random.default_rng(1).permutation(BOXES), []
    for turns, grown, places in ((0, 0.0, slice(None)), (40, 0.02, slice(None)), (40, 0.02, order)):
        for field, corner in zip(fields, (low - np.float32(grown), high + np.float32(grown))):
            field.from_numpy(np.ascontiguousarray(corner[places]))
        if not turns:
            boxes.build(*fields)
        for _ in range(turns):
            boxes.refit(*fields)
        builds.append(boxes.builds)
    return [n - builds[0] for n in builds]


@pytest.fixture(scope="module")
def listed():
    return spawn(_listed)


def test_levels_hold_the_sheet_and_end_in_patches_as_thick_as_the_fabric(listed):
    level, low, high = (listed["levels"][name] for name in ("level", "low", "high"))
    assert np.bincount(level).tolist() == [1, 2, 4, 8, 16, 8]
    for n in range(5):
        assert np.allclose(low[level == n].min(0), [0.0, 0.0, -0.05]) and (high[level == n].max(0)[:2] == [5, 4]).all()
    assert np.allclose((high - low)[level == 5], [1.0, 1.0, 0.1])


def test_a_tree_is_built_again_once_and_only_when_it_is_worn_out(listed):
    assert listed["builds"] == [0, 0, 1]


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("case", list(_inputs()))
def test_lists_are_those_of_numpy(listed, case, search):
    low, high, *queries = _inputs()[case]
    turns = [_expected(*boxes, *queries) for boxes in ((low, high), _moved(low, high))]
    turns.append([row[row % 2 == 0] for row in turns[1]])
    assert len(listed[case, search]) == (3 if search == "grid" else 2)
    for rows, expected in zip(listed[case, search], turns):
        assert len(rows) == len(expected)
        assert all(np.array_equal(a, b) for a, b in zip(rows, expected))
