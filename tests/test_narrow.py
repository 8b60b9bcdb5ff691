"""Narrow phases: against rational arithmetic on queries made to be hard, and as a command on files right and wrong."""

import os

import numpy as np
import pytest

import main as seep
from sim.studies.exact_ccd import meets
from sim.studies.hard_queries import queries
from tests.spawned import spawn

MANY = os.environ.get("SEEP_SLOW") == "1"
"""Thousands of queries instead of some hundred: SEEP_SLOW=1 pytest tests/test_narrow.py, 10 minutes."""
COUNT = 4000 if MANY else 50


def _judged(precision: str, count: int) -> dict[str, np.ndarray]:
    from sim import runtime
    from sim.studies.narrow import Judge, phases

    runtime.start(threads=2, precision=precision)
    judge = Judge(phases()["ccd"], count, precision)
    return {kind: judge.answer(v)[0] for kind, v in queries(count).items()}


@pytest.fixture(scope="module")
def truth() -> dict[str, list]:
    return {kind: [meets(query) for query in v] for kind, v in queries(COUNT).items()}


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_ccd_misses_nothing_that_rational_arithmetic_finds(truth, precision):
    hits = spawn(_judged, precision, COUNT)
    assert sum(t is True for answers in truth.values() for t in answers) > COUNT / 2
    for kind, answers in truth.items():
        missed = [k for k, (t, hit) in enumerate(zip(answers, hits[kind])) if t and not hit]
        assert not missed, kind
    assert not any(hit for t, hit in zip(truth["scattered"], hits["scattered"]) if t is False)


def _through() -> np.ndarray:
    """A point that falls through a still triangle half way, one that passes beside it, and one caught from behind."""
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    v = np.zeros((3, 8, 3))
    v[:, 1:4], v[:, 5:] = triangle, triangle
    v[:2, 0], v[:2, 4] = [0.25, 0.25, 1.0], [0.25, 0.25, -1.0]
    v[1, [0, 4], :2] = 0.75
    v[2, 0], v[2, 4] = [0.25, 0.25, 0.1], [0.25, 0.25, 0.1]
    v[2, 5:, 2] = 0.4
    return v


def _command(folder: str) -> tuple[int, dict]:
    code = seep.main(["compare", "ccd", "--queries", f"{folder}/q.npz", "--out", f"{folder}/out.npz", "--threads", "1"])
    with np.load(f"{folder}/out.npz") as file:
        return code, {name: file[name] for name in file.files}


def test_the_command_answers_for_each_phase(tmp_path):
    np.savez(tmp_path / "q.npz", V=_through(), truth=[1, 0, 1], toi=[0.5, np.nan, 0.25])
    code, out = spawn(_command, str(tmp_path))
    assert code == 0
    assert out["hit"].tolist() == [True, False, True]
    assert out["toi"] == pytest.approx([0.5, np.nan, 0.25], abs=1e-12, nan_ok=True)
    assert out["hit_plane_reflect"].tolist() == [True, True, False]


@pytest.mark.parametrize(
    "arrays, line",
    [
        (None, "no such file"),
        (b"PK but no archive", "not an .npz file of plain arrays"),
        ({"W": np.zeros(3)}, "V: missing; queries of shape (n, 8, 3), the file has W"),
        ({"V": np.zeros((2, 8, 2))}, "V: float64 of shape (2, 8, 2); must be numbers of shape (n, 8, 3)"),
        ({"V": np.full((2, 8, 3), np.nan)}, "V: query 0: coordinates must lie within +-1e+09 m"),
        ({"V": np.zeros((2, 8, 3)), "truth": np.zeros(3)}, "truth: float64 of shape (3,); must be (2,)"),
    ],
    ids=["absent", "broken", "no V", "shape", "nan", "truth"],
)
def test_a_wrong_file_is_one_line(arrays, line, tmp_path, capsys):
    path = tmp_path / "q.npz"
    if isinstance(arrays, bytes):
        path.write_bytes(arrays)
    elif arrays:
        np.savez(path, **arrays)
    assert seep.main(["compare", "ccd", "--queries", str(path), "--out", str(tmp_path / "out.npz")]) == 2
    assert capsys.readouterr().err == f"{path}: {line}\n"


def test_the_chart_of_narrow_phases_is_drawn_from_its_csv_alone(tmp_path):
    import imageio.v3 as iio

    from render.narrow import narrow_chart
    from sim.studies.ablate import write_table
    from sim.studies.narrow_chart import COLUMNS, verdict

    right = {"phase": "ccd", "precision": "f32", "kind": "scene", "queries": 9, "hits": 4, "missed": 0, "false": 0}
    rows = [right | {"nanoseconds": 900.0}, right | {"phase": "plane_reflect", "missed": 3, "nanoseconds": 20.0}]
    write_table(tmp_path / "narrow.csv", COLUMNS, rows)
    narrow_chart(tmp_path / "narrow.csv", tmp_path / "narrow.png")
    assert iio.imread(tmp_path / "narrow.png").std() > 10
    assert verdict(rows).splitlines()[1] == "plane_reflect (f32): misses 3 of 4 hits, sees 0 in 5 misses, 20 ns"
