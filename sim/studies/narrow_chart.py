"""What each narrow phase costs and how often it is wrong, by kind of query, against rational arithmetic."""

from __future__ import annotations

import multiprocessing
from pathlib import Path
from typing import Any

import numpy as np

from sim.studies.ablate import write_table
from sim.studies.exact_ccd import meets
from sim.studies.hard_queries import queries
from sim.studies.search.timing import timed

COLUMNS = ("phase", "precision", "kind", "queries", "hits", "missed", "false", "nanoseconds")
"""Of narrow.csv. queries: those that have an answer, hits of which are true; missed, false: wrong answers among them;
nanoseconds: CPU time of one query, over copies of them in another order."""
FULL, QUICK = 400, 40
"""Queries of a kind."""
TIMED = 40_000
"""Queries that are timed together."""


def run(quick: bool, path: Path) -> list[dict[str, Any]]:
    """Rows of every phase in either precision, each in a process of its own on one thread; writes `path`."""
    asked = queries(QUICK if quick else FULL)
    truth = {kind: np.array([-1 if (t := meets(q)) is None else t for q in v]) for kind, v in asked.items()}
    rows: list[dict[str, Any]] = []
    for precision in ("f32", "f64"):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows += pool.apply(_judged, (precision, asked, truth))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_table(path, COLUMNS, rows)
    return rows


def _judged(precision: str, asked: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """The child: a row a phase and kind."""
    from sim import runtime
    from sim.studies.narrow import Judge, counts, phases

    runtime.start(threads=1, precision=precision)
    rows = []
    for name, phase in phases().items():
        judge = Judge(phase, TIMED, precision)
        for kind, v in asked.items():
            order = np.random.default_rng(7).integers(0, len(v), TIMED)
            order[: len(v)] = np.arange(len(v))
            hit, toi, _ = judge.answer(v[order])
            figures = counts(hit[: len(v)], toi[: len(v)], {"truth": truth[kind]})
            row = {"phase": name, "precision": precision, "kind": kind, "queries": int((truth[kind] >= 0).sum())}
            row |= {"hits": int((truth[kind] == 1).sum()), "missed": figures["missed"], "false": figures["false"]}
            rows.append(row | {"nanoseconds": 1e9 * timed(judge.again) / TIMED})
    runtime.stop()
    return rows


def verdict(rows: list[dict[str, Any]]) -> str:
    """A line a phase and precision: what it missed, what it saw that was not there, what a query of a scene costs."""
    lines = []
    for name, precision in dict.fromkeys((r["phase"], r["precision"]) for r in rows):
        mine = [r for r in rows if (r["phase"], r["precision"]) == (name, precision)]
        missed, false, hits, asked = (sum(r[key] for r in mine) for key in ("missed", "false", "hits", "queries"))
        cost = next(r["nanoseconds"] for r in mine if r["kind"] == "scene")
        wrong = f"misses {missed} of {hits} hits, sees {false} in {asked - hits} misses"
        lines.append(f"{name} ({precision}): {wrong}, {cost:.0f} ns")
    return "\n".join(lines)
