"""Seconds per simulated second of a sheet, side by side with pyPBD on the same sheet, and how far each stretches."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from sim import config
from sim.scene.build import build_scene
from sim.studies import rival

NAME = "cloth_10000"
SCENE = "bench_cloth"
SECONDS, QUICK_SECONDS = 2.0, 0.25
"""[s] Simulated."""
SAMPLE = 10
"""Steps between two looks at the stretch."""
SCRIPT = Path(__file__).parent / "peers" / "positionbased.py"


def run(quick: bool, threads: int, rounds: int, python: str | None, folder: Path, say: Callable[[str], None]) -> dict:
    """A line for bench.csv: medians over `rounds` of either side, in turns; theirs empty where there is no rival."""
    asked = order(QUICK_SECONDS if quick else SECONDS, threads)
    ours, theirs = [], []
    for turn in range(rounds):
        say(f"{NAME}: {turn + 1} of {rounds}")
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            ours.append(_sum_up(pool.apply(_ours, (asked,)), asked))
        if python:
            try:
                theirs.append(_sum_up(rival.run(python, asked, folder, SCRIPT), asked))
            except rival.NoRival as reason:
                say(f"the rival could not be run: {reason}")
                python = None
    row = _row(asked, ours, theirs)
    say(_words(row))
    return row


def order(seconds: float, threads: int) -> dict[str, Any]:
    """The scene in plain numbers, all that either side is given. SI, z up."""
    scene = config.load(SCENE)
    sheet = build_scene(scene).sheet
    n = sheet.shape[0]
    return {
        "case": NAME,
        "method": "cloth",
        "count": n * n,
        "nodes": n,
        "size": scene.cloth.size[0],
        "spacing": sheet.spacing,
        "mass": _theirs_of(sheet.mass, n),
        "held": [int(k % n * n + k // n) for k in sheet.pins],
        "stiffness": 0.75 * scene.cloth.fabric.stretch,
        "bending": scene.cloth.fabric.bending,
        "step": scene.run.dt_max,
        "substeps": round(scene.run.dt_max / scene.cloth.params.substep_max),
        "seconds": seconds,
        "sample": SAMPLE,
        "threads": threads,
    }


def _theirs_of(values: np.ndarray, n: int) -> list[float]:
    """Node i*n + j of ours is j*n + i of theirs: row by row from below."""
    return values.reshape(n, n).T.ravel().tolist()


def _ours(order: dict[str, Any]) -> dict[str, Any]:
    """Our run, in a process of its own."""
    import resource

    from sim import registry, runtime
    from sim.world import World

    runtime.start(threads=order["threads"])
    registry.discover()
    world = World(config.load(SCENE, [f"run.duration={order['seconds'] + 0.1}"]))
    solver, n = world.build.parts["cloth"], order["nodes"]
    start = world.save()
    world.step()
    world.load(start)
    steps, kept = [], []
    for turn in range(1, round(order["seconds"] / order["step"]) + 1):
        wall, cpu = time.perf_counter(), time.process_time()
        world.step()
        steps.append([time.perf_counter() - wall, time.process_time() - cpu])
        if turn % order["sample"] == 0:
            x = world.state["cloth.x"].to_numpy().reshape(n, n, 3)
            kept.append(x.transpose(1, 0, 2).reshape(-1, 3))
    springs = sum(len(f.row) * len(f.column) for f in solver.sheet.families)
    bends = 2 * n * (n - 2) + (n - 1) ** 2
    runtime.stop()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    positions = {"x": np.array(kept)}
    return {
        "steps": steps,
        "constraints": springs + bends,
        "springs": springs,
        "memory": memory,
        "positions": positions,
    }


def _sum_up(figures: dict[str, Any], order: dict[str, Any]) -> dict[str, float]:
    """One run in numbers. error: mean |strain| of the threads along and across, over the second half of the run."""
    wall, cpu = np.array(figures["steps"]).T
    x = np.asarray(figures["positions"]["x"], float).reshape(-1, order["nodes"], order["nodes"], 3)
    x = x[len(x) // 2 :]
    strains = [np.linalg.norm(np.diff(x, axis=k), axis=-1) / order["spacing"] - 1.0 for k in (1, 2)]
    each = 1e9 / (order["substeps"] * figures["constraints"])
    return {
        "s_per_s": wall.mean() / order["step"],
        "cpu_s_per_s": cpu.mean() / order["step"],
        "ns": wall.mean() * each,
        "cpu_ns": cpu.mean() * each,
        "constraints": figures["constraints"],
        "error": float(np.mean([np.abs(s).mean() for s in strains])),
        "densest": float(max(s.max() for s in strains)),
        "steps": len(wall),
        "dt": order["step"] / order["substeps"],
        "memory": figures["memory"],
    }


def _row(order: dict[str, Any], ours: list[dict], theirs: list[dict]) -> dict[str, Any]:
    a, b = ({k: median(r[k] for r in runs) for k in runs[0]} if runs else {} for runs in (ours, theirs))
    row = {"case": order["case"], "size": order["count"], "ours": a["s_per_s"], "rival": b.get("s_per_s")}
    row["ratio"] = a["s_per_s"] / b["s_per_s"] if b else None
    row |= {"our_error": a["error"], "rival_error": b.get("error")}
    row["cpu_ratio"] = a["cpu_s_per_s"] / b["cpu_s_per_s"] if b else None
    row |= {"seconds": order["seconds"], "threads": order["threads"], "load": os.getloadavg()[0]}
    rest = [name for name in a if name not in ("s_per_s", "error")]
    return row | {f"{side}_{name}": of.get(name) for name in rest for side, of in (("our", a), ("rival", b))}


WORDS = {
    "s_per_s": "s per simulated second",
    "cpu_s_per_s": "CPU s per simulated second",
    "ns": "ns a constraint and substep",
    "cpu_ns": "CPU ns, the same",
    "constraints": "constraints",
    "error": "mean strain of threads",
    "densest": "largest strain",
    "memory": "memory, bytes",
}


def _words(row: dict[str, Any]) -> str:
    """What a row says, as text."""
    ratio = f"ratio {row['ratio']:.3f}, of CPU {row['cpu_ratio']:.3f}" if row["ratio"] else ""
    lines = [f"{row['case']:30}{'ours':>20}{'rival':>20}   {ratio}"]
    row = row | {"our_s_per_s": row["ours"], "rival_s_per_s": row["rival"]}
    for name, words in WORDS.items():
        cells = (row[f"{side}_{name}"] for side in ("our", "rival"))
        lines.append(f"  {words:28}" + "".join(f"{'' if c is None else f'{c:.4g}':>20}" for c in cells))
    return "\n".join(lines)
