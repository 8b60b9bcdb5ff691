"""Every search over every meeting of water and cloth at a grid of sizes: what it costs, what it finds, and who wins."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim.checkpoint import write_text
from sim.errors import RunError

COLUMNS = (
    "scene", "patches", "points", "search", "build", "refit", "query", "total", "tried", "candidates", "hits", "memory",
)  # fmt: skip
"""Of searches.csv. build, refit, query [CPU s, one thread]; total: refit and query, what a step pays; tried: boxes that
a walk came to; candidates: boxes that touch a query; hits: triangles that a path passed; memory [bytes]."""
FITTED = ("search", "what", "of_points", "of_patches")
"""Of searches-fits.csv: time ~ points^of_points x patches^of_patches, by least squares over the logs, a scene its own
factor."""
ACCURACY = ("scene", "patches", "points", "search", "asked", "seconds", "missed", "false", "hits")
"""Of searches-accuracy.csv. asked: see timing.WAYS; seconds: CPU of refit and query; of the `hits` triangles that paths
pass, the share missed; false: candidates a particle that no path passes."""
WITHOUT_TREE = "grid"
CLOSE = 1.1
"""Times that differ by less are a draw."""


class Sizes(NamedTuple):
    """What is swept; brute force only where it tries no more boxes than `brute`."""

    patches: tuple[int, ...]
    points: tuple[int, ...]
    brute: float


FULL = Sizes((1_000, 4_000, 16_000, 64_000), (4_000, 32_000, 128_000), 2e8)
QUICK = Sizes((900, 3_600, 14_400), (4_000, 32_000), 3e7)


def run(sizes: Sizes, path: Path) -> Iterator[list[dict[str, Any]]]:
    """Rows of one number of patches after another; Taichi must have been started. Writes `path` and its fits each time.

    RunError where two searches do not find the same candidates and hits.
    """
    from sim.studies.search.meetings import KINDS, meeting
    from sim.studies.search.timing import Bench

    rows: list[dict[str, Any]] = []
    accuracy: list[dict[str, Any]] = []
    for patches in sizes.patches:
        bench = Bench(patches, max(sizes.points))
        searches = [bench.search(name) for name in ("brute", "grid", "bvh", "lbvh")]
        here = []
        for kind in KINDS:
            for points in sizes.points:
                met = meeting(kind, patches, points)
                bench.fill(met)
                for search in searches:
                    if search.name == "brute" and patches * points > sizes.brute:
                        continue
                    of = search.figures(met)
                    of |= {"scene": kind, "patches": bench.side**2, "points": points, "search": search.name}
                    here.append(of | {"total": of["refit"] + of["query"]})
                    if (patches, points) == (sizes.patches[-2], sizes.points[-1]):
                        accuracy += _accuracy(here[-1], search.accuracy(met))
        _agree(here)
        rows += here
        _write(path, COLUMNS, rows)
        _write(path.with_name(f"{path.stem}-fits.csv"), FITTED, fits(rows))
        _write(path.with_name(f"{path.stem}-accuracy.csv"), ACCURACY, accuracy)
        yield here


def _accuracy(row: dict[str, Any], asked: list[dict[str, Any]]) -> list[dict[str, Any]]:
    truth = asked[0]["hits"]
    return [
        {column: row[column] for column in ACCURACY[:4]}
        | {"asked": of["asked"], "seconds": row["refit"] + of["query"], "hits": truth}
        | {"missed": 1.0 - of["hits"] / truth if truth else 0.0}
        | {"false": (of["candidates"] - of["hits"]) / row["points"]}
        for of in asked
    ]


def _agree(rows: list[dict[str, Any]]) -> None:
    found: dict[tuple, tuple] = {}
    for row in rows:
        case, what = (row["scene"], row["patches"], row["points"]), (row["candidates"], row["hits"])
        if found.setdefault(case, what) != what:
            raise RunError(f"{row['search']} finds {what} of {case}, another search {found[case]}")


def fits(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Exponents of each search's times."""
    fitted = []
    scenes = sorted({row["scene"] for row in rows})
    for name in dict.fromkeys(row["search"] for row in rows):
        chosen = [row for row in rows if row["search"] == name]
        for what in ("build", "refit", "query"):
            if name == "brute" and what != "query":
                continue
            by_scene = [[float(row["scene"] == scene) for scene in scenes] for row in chosen]
            sizes = np.log([[row["points"], row["patches"]] for row in chosen])
            if what != "query":
                sizes = sizes[:, 1:]
            if (np.ptp(sizes, axis=0) == 0.0).any():
                continue
            times = np.log([max(row[what], 1e-9) for row in chosen])
            powers = np.linalg.lstsq(np.hstack([sizes, by_scene]), times, rcond=None)[0][: sizes.shape[1]]
            named = dict(zip(FITTED[2:] if what == "query" else FITTED[3:], powers.tolist()))
            fitted.append({"search": name, "what": what, "of_points": "", **named})
    return fitted


def verdict(rows: list[dict[str, Any]]) -> str:
    """When a search without a tree wins, and when not, in two sentences."""
    cases: dict[tuple, dict[str, float]] = {}
    for row in rows:
        cases.setdefault((row["scene"], row["patches"], row["points"]), {})[row["search"]] = row["total"]
    trees = ("bvh", "lbvh")
    ratio = {case: min(times[t] for t in trees) / times[WITHOUT_TREE] for case, times in cases.items()}
    wins, losses = ([c for c, r in ratio.items() if s(r)] for s in (lambda r: r > CLOSE, lambda r: r < 1.0 / CLOSE))
    brute = {case: times["brute"] / times[WITHOUT_TREE] for case, times in cases.items() if "brute" in times}
    small = max((case[1] * case[2] for case, r in brute.items() if r < CLOSE), default=0)
    first = (
        f"A step's search (refit and query) costs less without a tree in {len(wins)} of {len(ratio)} cases, at best "
        f"{max(ratio.values()):.1f} times less, and its build {_builds(rows):.1f} times less than the fastest tree's"
    )
    if small:
        first += f"; trying all boxes is as fast up to {small:.0e} pairs"
    if not losses:
        return f"{first}. A tree never wins by more than {100 * (CLOSE - 1.0):.0f} %."
    scenes = sorted({case[0] for case in losses}, key=lambda s: -sum(case[0] == s for case in losses))
    told = ", ".join(f"{s} ({sum(c[0] == s for c in losses)})" for s in scenes)
    near = {(r["scene"], r["patches"], r["points"]): r["candidates"] / r["points"] for r in rows}
    few, many = (np.median([near[case] for case in cases]) for cases in (losses, wins or losses))
    return (
        f"{first}. A tree that is refitted wins in {len(losses)}, by up to {1.0 / min(ratio.values()):.1f} times: "
        f"{told}, where a particle meets {few:.2g} boxes (median; {many:.2g} where the grid wins)."
    )


def _builds(rows: list[dict[str, Any]]) -> float:
    """Median over cases of the fastest tree's build over the grid's."""
    built = {}
    for row in rows:
        built.setdefault((row["scene"], row["patches"], row["points"]), {})[row["search"]] = row["build"]
    return float(np.median([min(b["bvh"], b["lbvh"]) / b[WITHOUT_TREE] for b in built.values()]))


def told(fitted: list[dict[str, Any]]) -> str:
    """Fitted exponents as text, a line a search."""
    lines = []
    for name in dict.fromkeys(fit["search"] for fit in fitted):
        parts = []
        for fit in (f for f in fitted if f["search"] == name):
            points = f"n^{fit['of_points']:.2f} " if fit["of_points"] != "" else ""
            parts.append(f"{fit['what']} ~ {points}m^{fit['of_patches']:.2f}")
        lines.append(f"{name:6} {', '.join(parts)}")
    return "\n".join(lines)


def _write(path: Path, columns: tuple[str, ...], rows: list[dict[str, Any]]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows({c: f"{row[c]:.4g}" if isinstance(row[c], float) else row[c] for c in columns} for row in rows)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text.getvalue())
