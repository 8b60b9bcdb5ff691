"""The other program: found, run in a process and an environment of its own, and its figures read back."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from sim.errors import ConfigError

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = Path(__file__).parent / "peers" / "splishsplash.py"
LIMIT = 3600
"""[s] A run that takes longer than this hangs."""


class NoRival(Exception):
    """The rival could not be run; the text says why, in a line."""


def interpreter() -> str:
    """The Python that has the rivals: SEEP_PEERS, else that of .venv-peers. NoRival where there is neither."""
    named = os.environ.get("SEEP_PEERS")
    if named:
        if not os.access(named, os.X_OK) or os.path.isdir(named):
            raise ConfigError(f"SEEP_PEERS = {named}: must be a Python interpreter that has pySPlisHSPlasH")
        return named
    own = ROOT / ".venv-peers" / "bin" / "python"
    if not own.exists():
        raise NoRival("there is no .venv-peers; `make bench` makes it, or SEEP_PEERS names another Python")
    return str(own)


def run(python: str, order: dict[str, Any], folder: Path, script: Path = SCRIPT) -> dict[str, Any]:
    """Figures of the order (see sim.studies.bench.order): lists `steps`, `samples`, `positions` by time, `stages`.

    folder keeps the scene file, and the boundary map that the rival builds once a radius. NoRival if it fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{order['method']}_{order['count']}"
    figures, positions, log = (folder / f"{name}_{part}" for part in ("figures.json", "positions.npz", "log.txt"))
    figures.unlink(missing_ok=True)
    path = folder / f"{name}_order.json"
    path.write_text(json.dumps(order | {"figures": str(figures), "positions": str(positions)}, indent=1))
    try:
        with log.open("w") as out:
            command = [python, str(script), str(path)]
            threads = {"OMP_NUM_THREADS": str(order["threads"])}
            done = subprocess.run(command, stdout=out, stderr=out, timeout=LIMIT, env=os.environ | threads)
    except subprocess.TimeoutExpired:
        raise NoRival(f"{name} did not end within {LIMIT} s") from None
    if done.returncode or not figures.exists():
        last = (log.read_text(errors="replace").strip().splitlines() or ["no word"])[-1]
        raise NoRival(f"{name} ended with {done.returncode}: {last} (see {log})")
    found = json.loads(figures.read_text())
    with np.load(positions) as kept:
        found["positions"] = {time: kept[time] for time in kept.files}
    return found | {"stages": _stages(log.read_text(errors="replace"))}


def _stages(log: str) -> dict[str, float]:
    """Seconds by stage, as the rival's own clock printed them: "Time sum: neighborhood_search: 44.65 ms"."""
    sums = {name: 1e-3 * float(ms) for name, ms in re.findall(r"Time sum: (\w+): ([\d.e+-]+) ms", log)}
    whole = sums.pop("SimStep", 0.0)
    return sums | {"the rest": whole - sum(sums.values())} if sums else {}
