"""compare: exponents are those that the times were made with, the verdict says who won, the chart is drawn."""

import csv

import numpy as np
import pytest

from sim.errors import RunError
from sim.studies.search import compare, meetings

POWERS = {"brute": (1.0, 1.0), "grid": (1.0, 0.0), "bvh": (1.0, 0.2), "lbvh": (0.9, 0.1)}


def _rows(tree: float = 2.0) -> list[dict]:
    """Times by formula; those of the trees `tree` times the grid's at (1, 1)."""
    rows = []
    for scene, factor in (("jet", 1.0), ("splash", 3.0)):
        for patches in (100, 1000):
            for points in (1000, 10000):
                for name, (n, m) in POWERS.items():
                    query = 1e-7 * factor * points**n * patches**m * (tree if name in ("bvh", "lbvh") else 1.0)
                    build = 1e-8 * patches * (5.0 if name == "bvh" else 2.0 if name == "lbvh" else 1.0)
                    rows.append({"scene": scene, "patches": patches, "points": points, "search": name, "build": build,
                                 "refit": 0.0, "query": query, "total": query, "tried": 9, "candidates": 5 * points,
                                 "hits": 1, "memory": 64})  # fmt: skip
    return rows


def test_exponents_are_fitted():
    fits = {(f["search"], f["what"]): (f["of_points"], f["of_patches"]) for f in compare.fits(_rows())}
    for name, powers in POWERS.items():
        assert fits[name, "query"] == pytest.approx(powers, abs=1e-9)
    assert fits["bvh", "build"] == ("", pytest.approx(1.0))


def test_the_verdict_says_who_won():
    assert "without a tree in 8 of 8 cases" in compare.verdict(_rows()) and "never wins" in compare.verdict(_rows())
    lost = compare.verdict(_rows(tree=0.1))
    assert "without a tree in 0 of 8 cases" in lost and "wins in 8" in lost


def test_searches_that_disagree_are_refused():
    rows = _rows()
    rows[1]["hits"] = 2
    with pytest.raises(RunError, match="grid finds"):
        compare._agree(rows)


def test_the_chart_is_drawn_from_its_tables(tmp_path):
    from render.searches import search_chart

    path = tmp_path / "searches.csv"
    compare._write(path, compare.COLUMNS, _rows())
    compare._write(tmp_path / "searches-fits.csv", compare.FITTED, compare.fits(_rows()))
    assert len(list(csv.DictReader(path.open()))) == len(_rows())
    search_chart(path, tmp_path / "searches.png")
    assert (tmp_path / "searches.png").stat().st_size > 20_000


@pytest.mark.parametrize("kind", list(meetings.KINDS))
def test_a_meeting_has_its_water_and_patches_and_moves(kind):
    met = meetings.meeting(kind, 400, 500)
    low, high = met.boxes(0, 0.0)
    assert met.x.shape == met.x1.shape == (500, 3) and low.shape == (400, 3)
    assert (low <= high).all()
    moved = np.abs(met.nodes[1] - met.nodes[0]).max()
    assert 0.05 * met.patch < moved <= meetings.SWAY * met.patch * (1 + 1e-6)
    assert np.abs(met.x1 - met.x).max() <= meetings.PATH * met.patch
