"""Narrow phases against exact truth: does a moving point meet a moving triangle, and when."""

import time
import zipfile
from pathlib import Path

import numpy as np
import taichi as ti

from sim import registry
from sim.errors import ConfigError, RunError
from sim.maths.ccd import EXACT, ROUNDED

FARTHEST = 1e9
"""[m] Of coordinates; cubes of them must not overflow."""


def read(path: Path) -> dict[str, np.ndarray]:
    """Queries V (n, 8, 3): v, f0, f1, f2 at t0, then at t1; and `truth` (n,), `toi` (n,) where the file has them.

    ConfigError: one line that names file, array and what it must be.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in ("V", "truth", "toi") if name in file.files}
            names = ", ".join(file.files)
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, ValueError, EOFError, AttributeError, zipfile.BadZipFile):
        raise ConfigError(f"{path}: not an .npz file of plain arrays") from None
    if "V" not in found:
        raise ConfigError(f"{path}: V: missing; queries of shape (n, 8, 3), the file has {names or 'nothing'}")
    v = found["V"]
    if v.ndim != 3 or v.shape[1:] != (8, 3) or v.dtype.kind not in "fiu":
        raise ConfigError(f"{path}: V: {v.dtype} of shape {v.shape}; must be numbers of shape (n, 8, 3)")
    wrong = ~(np.abs(v) <= FARTHEST).all((1, 2))
    if wrong.any():
        raise ConfigError(f"{path}: V: query {int(wrong.argmax())}: coordinates must lie within +-{FARTHEST:g} m")
    for name in ("truth", "toi"):
        if name in found and (found[name].shape != v.shape[:1] or found[name].dtype.kind not in "biuf"):
            raise ConfigError(f"{path}: {name}: {found[name].dtype} of shape {found[name].shape}; must be ({len(v)},)")
    return found


def phases() -> dict[str, object]:
    """Narrow phase @ti.func of every contact method, by name, the continuous one first."""
    registry.discover()
    methods = registry.methods("coupling.contact")
    return {name: methods[name].narrow for name in sorted(methods, key=lambda n: n != "ccd")}


@ti.data_oriented
class Judge:
    """One narrow phase over many queries, in the precision that Taichi was started with."""

    def __init__(self, phase, count: int, precision: str):
        self.phase = phase
        self.real = np.float64 if precision == "f64" else np.float32
        self.points = ti.Vector.field(3, float, shape=(max(count, 1), 8))
        self.slack, self.toi = ti.field(ti.f64, shape=max(count, 1)), ti.field(ti.f64, shape=max(count, 1))

    def answer(self, queries: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
        """V (n, 8, 3) -> (hit (n,) bool, toi (n,) in 0..1, nan where no hit, seconds)."""
        self._judge(0)
        if len(queries):
            points = queries.astype(self.real)
            self.points.from_numpy(points)
            self.slack.from_numpy(np.where((points == queries).all((1, 2)), EXACT, ROUNDED))
        began = time.perf_counter()
        self._judge(len(queries))
        seconds = time.perf_counter() - began
        toi = self.toi.to_numpy()[: len(queries)]
        return toi <= 1.0, np.where(toi <= 1.0, toi, np.nan), seconds

    def again(self) -> None:
        """All queries that there is room for, as `answer` left them, without copying."""
        self._judge(self.slack.shape[0])

    @ti.kernel
    def _judge(self, count: ti.i32):
        for i in range(count):
            x0, a0, b0, c0 = self.points[i, 0], self.points[i, 1], self.points[i, 2], self.points[i, 3]
            x1, a1, b1, c1 = self.points[i, 4], self.points[i, 5], self.points[i, 6], self.points[i, 7]
            self.toi[i] = self.phase(x0, x1, a0, a1, b0, b1, c0, c1, self.slack[i])[0]


def counts(hit: np.ndarray, toi: np.ndarray, given: dict[str, np.ndarray]) -> dict[str, float]:
    """missed, false, right: hits against truth (1, 0; else: degenerate, not counted), and the largest error of toi."""
    truth = given["truth"].astype(int)
    figures = {
        "missed": int(((truth == 1) & ~hit).sum()),
        "false": int(((truth == 0) & hit).sum()),
        "right": int(((truth == 1) & hit).sum() + ((truth == 0) & ~hit).sum()),
        "undecided": int(((truth != 0) & (truth != 1)).sum()),
    }
    if "toi" in given:
        both = (truth == 1) & hit & np.isfinite(given["toi"])
        figures["toi_error"] = float(np.abs(toi - given["toi"])[both].max(initial=0.0))
    return figures


def compare(given: dict[str, np.ndarray], out: Path, precision: str, say=print) -> dict[str, dict]:
    """Every narrow phase on queries from `read`; writes `hit` and `toi` of ccd, and hit_NAME, toi_NAME of each other.

    Taichi must have been started in this precision. Returns figures by phase (empty without truth); says a line each.
    """
    written, figures = {}, {}
    for name, phase in phases().items():
        hit, toi, seconds = Judge(phase, len(given["V"]), precision).answer(given["V"])
        tail = "" if name == "ccd" else f"_{name}"
        written |= {f"hit{tail}": hit, f"toi{tail}": toi}
        figures[name] = counts(hit, toi, given) if "truth" in given else {}
        told = [f"{int(hit.sum())} hits of {len(hit)}"]
        told += [
            f"{key.replace('_', ' ')} {value if isinstance(value, int) else f'{value:.2g}'}"
            for key, value in figures[name].items()
        ]
        say(f"{name} ({precision}): {', '.join(told)}; {1e9 * seconds / max(len(hit), 1):.0f} ns a query")
    try:
        with open(out, "wb") as file:
            np.savez(file, **written)
    except OSError as error:
        raise RunError(f"{out}: cannot write: {error.strerror}") from error
    return figures
