"""Seconds per simulated second, side by side with another program on the same scene, and how right each is."""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from sim import config, registry
from sim.errors import ConfigError, RunError
from sim.studies import bench_cloth, rival, stopwatch
from sim.studies.compression import mean_compression
from sim.studies.search import rivals

SCENE = "bench_block"
ROUNDS = 3
"""Ours, theirs, ours, theirs, ...: medians of this many."""
SAMPLE, KEEP = 0.02, 5
"""[s] of simulated time between two looks at the density; and after how many of them positions are kept."""
BUSY = 0.5
"""[1] Load average above which wall times of two programs cannot be compared: one may wait where the other did not."""


@dataclass(frozen=True)
class Duel:
    """One method at one size: side^3 particles, 1 m/(side + 1) apart, for `seconds` of simulated time.

    step: [s] the same fixed step for both; 0 lets both take the largest that the CFL number allows.
    """

    method: str
    side: int
    seconds: float
    step: float = 0.0

    @property
    def name(self) -> str:
        """method_particles."""
        return f"{self.method}_{self.side**3}"

    def overrides(self) -> list[str]:
        """What is laid over the scene: the method, the lattice, and the block where the rival's lattice stands."""
        d = 1.0 / (self.side + 1)
        low = [-1.95 + 0.5 * d, -0.5 * self.side * d, 0.05 + 0.5 * d]
        block = {"low": low, "high": [a + self.side * d for a in low]}
        settings = [f"fluid.block.cube.{k}={v!r}" for k, v in block.items()]
        settings += [f'fluid.method="{self.method}"', f"fluid.spacing={d!r}", f"run.duration={self.seconds!r}"]
        return settings + ([f"run.dt_max={self.step!r}"] if self.step else [])


DUELS = (
    Duel("dfsph", 26, 1.0),
    Duel("dfsph", 38, 1.0),
    Duel("wcsph", 26, 0.5, 5e-4),
    Duel("wcsph", 38, 0.5, 5e-4),
    Duel("pbf", 26, 1.0),
)
"""Each is run if its method is there."""
QUICK = (Duel("dfsph", 12, 0.3),)
BOXES = "boxes"


def run(case: str, quick: bool, threads: int, rounds: int, folder: Path, say: Callable[[str], None]) -> Path:
    """Every duel whose name begins with `case`; FOLDER/bench.csv and stages.csv of water, bench_cloth.csv; the first.

    Of the case `boxes`, searches over a sheet's boxes, FOLDER/boxes.csv instead; left out if quick and not named.
    Where the rival cannot be run, that is said and its cells stay empty. rounds: 0 takes ROUNDS, or one if `quick`.
    """
    registry.discover()
    duels = [d for d in (QUICK if quick else DUELS) if d.method in registry.methods("fluid.pressure")]
    chosen = [d for d in duels if d.name.startswith(case)]
    boxes = BOXES.startswith(case) if case else not quick
    sheet = bench_cloth.NAME.startswith(case) if case else not quick
    if not chosen and not boxes and not sheet:
        names = [*(d.name for d in duels), BOXES, bench_cloth.NAME]
        raise ConfigError(f"bench {case}: no such case; choose from {', '.join(names)}")
    if boxes:
        path = rivals.run(quick, threads, folder, say)
        if not chosen and not sheet:
            return path
    try:
        python = rival.interpreter()
    except rival.NoRival as reason:
        python = None
        say(f"no rival: {reason}")
    if os.getloadavg()[0] > BUSY:
        say(f"this machine is busy (load {os.getloadavg()[0]:.1f}): trust CPU seconds with --threads 1, not wall time")
    rows: list[dict] = []
    stages: list[dict] = []
    for duel in chosen:
        order = orders(duel, threads)
        ours, theirs = _take_turns(duel, order, rounds or (1 if quick else ROUNDS), python, folder / "rival", say)
        rows.append(_row(order, ours, theirs))
        of_case = [*_stages(order, "ours", ours), *_stages(order, "rival", theirs)]
        stages += of_case
        _write(folder / "bench.csv", rows)
        _write(folder / "stages.csv", stages)
        say(_table(rows[-1], of_case))
    if sheet:
        turns = rounds or (1 if quick else ROUNDS)
        _write(folder / "bench_cloth.csv", [bench_cloth.run(quick, threads, turns, python, folder / "rival", say)])
    return folder / ("bench.csv" if chosen else "bench_cloth.csv")


def orders(duel: Duel, threads: int) -> dict[str, Any]:
    """A duel's scene in plain numbers, all that either side is given. SI, z up; for sim/studies/peers, as JSON."""
    scene = config.load(SCENE, duel.overrides())
    fluid, params, block = scene.fluid, scene.fluid.params, scene.fluid.block["cube"]
    return {
        "case": duel.name,
        "method": duel.method,
        "count": duel.side**3,
        "spacing": fluid.spacing,
        "block": [block.low, block.high],
        "tank": scene.solid["tank"].size,
        "rest_density": fluid.liquid.rest_density,
        "nu": fluid.liquid.nu,
        "gravity": -scene.space.gravity[2],
        "cfl": params.cfl,
        "dt_max": scene.run.dt_max,
        "step": duel.step,
        "density_error": config.load(SCENE).fluid.params.density_error,
        "stiffness": fluid.liquid.rest_density * getattr(params, "sound_speed", 0.0) ** 2 / 7.0,
        "seconds": duel.seconds,
        "sample": SAMPLE,
        "keep": KEEP,
        "threads": threads,
    }


def _take_turns(duel: Duel, order: dict, rounds: int, python: str | None, folder: Path, say) -> tuple[list, list]:
    """Figures of each run, ours and theirs; theirs is empty where there is no rival, or it failed."""
    ours, theirs = [], []
    for turn in range(rounds):
        say(f"{duel.name}: {turn + 1} of {rounds}")
        ours.append(stopwatch.run(SCENE, duel.overrides(), order))
        if python:
            try:
                theirs.append(rival.run(python, order, folder))
            except rival.NoRival as reason:
                say(f"the rival could not be run: {reason}")
                python = None
    return ours, theirs


def _sum_up(figures: dict[str, Any], order: dict[str, Any]) -> dict[str, float]:
    """One run in numbers. Times leave the first step out, in which the rival builds its boundary map."""
    steps, samples = np.array(figures["steps"])[1:], np.array(figures["samples"])
    late = steps[:, 0] > 0.5 * order["seconds"]
    high = 0.5 * np.array(order["tank"])
    low, high = -high * (1, 1, 0), high * (1, 1, 2)
    places = [x for time, x in figures["positions"].items() if float(time) > 0.0]
    common = np.mean([mean_compression(x, order["spacing"], low, high) for x in places], axis=0)
    return {
        "s_per_s": steps[:, 2].sum() / steps[:, 1].sum(),
        "s_per_s_second_half": steps[late, 2].sum() / steps[late, 1].sum(),
        "cpu_s_per_s": steps[:, 3].sum() / steps[:, 1].sum(),
        "ns": 1e9 * steps[:, 2].mean() / figures["count"],
        "cpu_ns": 1e9 * steps[:, 3].mean() / figures["count"],
        "steps": len(steps) + 1,
        "dt": steps[:, 1].mean(),
        "iterations": steps[:, 4:].sum(1).mean(),
        "iterations_first": steps[:, 4].mean(),
        "iterations_second": steps[:, 5].mean(),
        "neighbours": samples[:, 3].mean(),
        "error": samples[:, 1].mean(),
        "densest": samples[:, 2].max(),
        "common_error": common[0],
        "common_density": common[1],
        "memory": figures["memory"],
    }


def _row(order: dict[str, Any], ours: list[dict], theirs: list[dict]) -> dict[str, Any]:
    """A line of bench.csv: medians over the runs."""
    sides = {"our": ours, "rival": theirs}
    a, b = (
        {name: median(run[name] for run in runs) for name in runs[0]} if runs else {}
        for runs in ([_sum_up(figures, order) for figures in side] for side in sides.values())
    )
    row = {"case": order["case"], "size": order["count"], "ours": a["s_per_s"], "rival": b.get("s_per_s")}
    row["ratio"] = a["s_per_s"] / b["s_per_s"] if b else None
    row |= {"our_error": a["error"], "rival_error": b.get("error")}
    row["cpu_ratio"] = a["cpu_s_per_s"] / b["cpu_s_per_s"] if b else None
    row |= {"seconds": order["seconds"], "threads": order["threads"], "load": os.getloadavg()[0]}
    row |= {f"{side}_solves": " ".join(runs[0]["solves"]) if runs else None for side, runs in sides.items()}
    rest = [name for name in a if name not in ("s_per_s", "error")]
    return row | {f"{side}_{name}": of.get(name) for name in rest for side, of in zip(sides, (a, b))}


def _stages(order: dict[str, Any], side: str, runs: list[dict]) -> list[dict[str, Any]]:
    """Lines of stages.csv: ns per particle and step of each stage, median over the runs."""
    return [
        {
            "case": order["case"],
            "side": side,
            "stage": name,
            "ns": median(1e9 * run["stages"][name] / (len(run["steps"]) * run["count"]) for run in runs),
        }
        for name in (runs[0]["stages"] if runs else ())
    ]


def _write(path: Path, rows: list[dict[str, Any]]) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    except OSError as error:
        raise RunError(f"{path}: {error.strerror}") from error


WORDS = {
    "s_per_s": "s per simulated s",
    "s_per_s_second_half": "  in its second half",
    "cpu_s_per_s": "CPU s per simulated s",
    "ns": "ns per particle and step",
    "steps": "steps",
    "solves": "pressure solves of a step",
    "iterations": "iterations a step",
    "iterations_first": "  in the first solve",
    "iterations_second": "  in the second",
    "neighbours": "neighbours",
    "error": "mean density error",
    "common_error": "  by one measure for both",
    "common_density": "mean density, by the same",
    "densest": "densest, of rho0",
}


def _table(row: dict[str, Any], stages: list[dict[str, Any]]) -> str:
    """What a row says, as text."""
    ratio = f"ratio {row['ratio']:.2f}, of CPU {row['cpu_ratio']:.2f}" if row["ratio"] else ""
    lines = [f"{row['case']:30}{'ours':>20}{'rival':>20}   {ratio}"]
    row = row | {"our_s_per_s": row["ours"], "rival_s_per_s": row["rival"]}
    for name, words in WORDS.items():
        cells = [row[f"{side}_{name}"] for side in ("our", "rival")]
        if not any(cells):  # a method without a pressure solve
            continue
        texts = ("" if c is None else c if isinstance(c, str) else f"{c:.4g}" for c in cells)
        lines.append(f"  {words:28}" + "".join(f"{text:>20}" for text in texts))
    for side in ("ours", "rival"):
        lines += [f"  {side}: {s['stage']:{26 - len(side)}}{s['ns']:20.0f} ns" for s in stages if s["side"] == side]
    return "\n".join(lines)
