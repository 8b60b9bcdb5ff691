"""Our searches over boxes beside Warp's mesh BVH: the same triangles, points and query boxes."""

from __future__ import annotations

import csv
import json
import multiprocessing
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import RunError
from sim.studies import rival

SCRIPT = Path(__file__).parents[1] / "peers" / "warp_boxes.py"
SIZES, QUICK = (100_000, 1_000_000), (4_000, 40_000)
"""Patches of two triangles each, and points."""
SEARCHES = ("grid", "lbvh", "bvh")
REPEATS = 5
COLUMNS = "search threads boxes points build refit query build_cpu refit_cpu query_cpu met load version".split()
"""Of boxes.csv: times in s by the wall and of CPU; met: boxes that touched a query, in all."""


def run(quick: bool, threads: int, folder: Path, say: Callable[[str], None]) -> Path:
    """Times of all sides, theirs where there is a rival; writes FOLDER/boxes.csv. RunError where counts differ."""
    patches, points = QUICK if quick else SIZES
    order = scene(patches, points)
    rows = []
    for name in SEARCHES:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows.append(pool.apply(_ours, (name, threads, order)))
        say(_line(rows[-1], points))
    try:
        rows.append(_theirs(rival.interpreter(), order, folder))
        say(_line(rows[-1], points))
    except rival.NoRival as reason:
        say(f"no rival for boxes: {reason}")
    if len({row["met"] for row in rows}) > 1:
        raise RunError("boxes met differ: " + ", ".join(f"{row['search']} {row['met']}" for row in rows))
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "boxes.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    return folder / "boxes.csv"


def scene(patches: int, points: int) -> dict[str, Any]:
    """A wavy sheet of 1 m, its moved twin, and points within a patch of it, sorted by cells; query boxes of a patch."""
    random = np.random.default_rng(3)
    side = round(np.sqrt(patches))
    u, v = np.meshgrid(*[np.linspace(0.0, 1.0, side + 1)] * 2, indexing="ij")

    def height(u, v, phase=0.0):
        return 0.05 * np.sin(9.0 * u + phase) * np.cos(7.0 * v)

    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1, 1)
    triangles = np.stack([first + [0, side + 1, side + 2], first + [0, side + 2, 1]], 1).reshape(-1, 3)
    x = random.uniform(0.0, 1.0, (points, 3))
    x[:, 2] = height(x[:, 0], x[:, 1]) + random.uniform(-1.0, 1.0, points) / side
    cell = np.floor(x * side / 2.0).astype(int)
    return {
        "x": np.stack([u, v, height(u, v)], -1).reshape(-1, 3).astype(np.float32),
        "moved": np.stack([u, v, height(u, v, 0.05)], -1).reshape(-1, 3).astype(np.float32),
        "triangles": triangles.astype(np.int32),
        "points": x[np.lexsort((cell[:, 0], cell[:, 1], cell[:, 2]))].astype(np.float32),
        "half": np.float32(0.5 / side),
    }


def _ours(name: str, threads: int, order: dict[str, Any]) -> dict[str, Any]:
    from sim import registry, runtime

    runtime.start(threads=threads)
    import taichi as ti

    registry.discover()
    from sim.studies.search.counting import Counter

    corners, moved = (order[key][order["triangles"]] for key in ("x", "moved"))
    fields = [ti.Vector.field(3, float, shape=len(corners)) for _ in range(2)]
    points = ti.Vector.field(3, float, shape=len(order["points"]))
    points.from_numpy(order["points"])
    boxes = registry.method("search.boxes", name)(len(corners))
    counter = Counter(boxes, *fields, points)

    def place(at):
        fields[0].from_numpy(at.min(1))
        fields[1].from_numpy(at.max(1))

    place(corners)
    laps = {"build": timed(lambda: boxes.build(*fields))}
    laps["query"] = timed(lambda: counter.count(float(order["half"])))
    met = counter.count(float(order["half"]))
    place(moved)
    laps["refit"] = timed(lambda: boxes.refit(*fields))
    runtime.stop()
    return _row(name, threads, len(corners), len(order["points"]), laps, met, "")


def _theirs(python: str, order: dict[str, Any], folder: Path) -> dict[str, Any]:
    folder = (folder / "rival").absolute()
    folder.mkdir(parents=True, exist_ok=True)
    given, figures, log = (folder / f"boxes_{part}" for part in ("order.npz", "figures.json", "log.txt"))
    figures.unlink(missing_ok=True)
    np.savez(given, **order)
    with log.open("w") as out:
        command = [python, str(SCRIPT), str(given), str(figures)]
        done = subprocess.run(command, stdout=out, stderr=out, timeout=rival.LIMIT)
    if done.returncode or not figures.exists():
        last = (log.read_text(errors="replace").strip().splitlines() or ["no word"])[-1]
        raise rival.NoRival(f"Warp ended with {done.returncode}: {last}")
    told = json.loads(figures.read_text())
    sizes = len(order["triangles"]), len(order["points"])
    return _row("Warp's wp.Mesh", 1, *sizes, told, told["met"], told["version"])


def _row(name: str, threads: int, boxes: int, points: int, laps: dict, met: int, version: str) -> dict[str, Any]:
    row = {"search": name, "threads": threads, "boxes": boxes, "points": points, "met": met, "version": version}
    for what in ("build", "refit", "query"):
        row |= {what: laps[what]["wall"], f"{what}_cpu": laps[what]["cpu"]}
    return row | {"load": round(os.getloadavg()[0], 2)}


def _line(row: dict[str, Any], points: int) -> str:
    return (
        f"{row['search']:16} {row['threads']} thread{'s' * (row['threads'] > 1):1}  build {1e3 * row['build']:7.2f} ms"
        f"  refit {1e3 * row['refit']:6.2f} ms  query {1e9 * row['query'] / points:5.0f} ns a point"
        f" (CPU {1e9 * row['query_cpu'] / points:.0f})  {row['met']} met"
    )


def timed(act: Callable[[], object]) -> dict[str, float]:
    """Medians of wall and CPU seconds; the first go compiles and is not counted."""
    act()
    laps = []
    for _ in range(REPEATS):
        wall, cpu = time.perf_counter(), time.process_time()
        act()
        laps.append((time.perf_counter() - wall, time.process_time() - cpu))
    return dict(zip(("wall", "cpu"), np.median(laps, axis=0).tolist()))
