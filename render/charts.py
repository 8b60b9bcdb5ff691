"""Charts, each drawn from its CSV and nothing else."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Iterable
from pathlib import Path

import matplotlib
import numpy as np

from sim.errors import RunError

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402  (the backend must be chosen first: there may be no display)

HOLDERS = (  # column, what a stranger reads, colour; from the bottom of the stack up
    ("held", "held in the cloth's pores", "#b5532f"),
    ("film", "film hanging below the cloth", "#e09a5f"),
    ("free", "free water: stream, pool, drops, basin", "#7fb2d6"),
    ("drained", "drained out of the domain", "#9aa3ad"),
    ("dried", "dried into the air", "#d9d3b8"),
)
STYLE = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "figure.dpi": 120,
    "legend.frameon": False,
}


def read_rows(path: Path, what: str = "rows", columns: Iterable[str] = ()) -> list[dict[str, str]]:
    """Rows of a CSV that has these columns. RunError if it cannot be read, or there is no `what` to draw."""
    try:
        with open(path, newline="") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise RunError(f"{path}: cannot read: {error.strerror}") from error
    if not rows or not set(columns) <= set(rows[0]):
        raise RunError(f"{path}: no {what} to draw")
    return rows


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV by the names in its header, f64; an empty cell (not modelled) is nan. RunError if unreadable."""
    rows = read_rows(path)
    try:
        return {name: np.array([float(r[name]) if r[name] else math.nan for r in rows]) for name in rows[0]}
    except (TypeError, ValueError) as error:
        raise RunError(f"{path}: not a table of numbers: {error}") from error


def save(figure, path: Path) -> None:
    """Write a figure as PNG atomically and close it. RunError if the disk refuses."""
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        figure.savefig(part, format="png")
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror}") from error
    finally:
        plt.close(figure)


def ledger_chart(csv_path: Path, png_path: Path) -> None:
    """Where every gram is over a run, and below it speed, strain and density error, from ledger.csv."""
    table = read_table(csv_path)
    panels = [p for p in _panels(table) if np.isfinite(p[1]).any()]
    water = np.isfinite(table["emitted"]).any()
    with plt.rc_context(STYLE):
        heights = ([2.6] if water else []) + [1.0] * math.ceil(len(panels) / 2)
        figure = plt.figure(figsize=(9.0, 1.9 * sum(heights) + 0.4), layout="constrained")
        grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
        if water:
            _stack(figure.add_subplot(grid[0, :]), table)
        for k, panel in enumerate(panels):
            last_alone = k == len(panels) - 1 and k % 2 == 0
            cell = grid[int(water) + k // 2, :] if last_alone else grid[int(water) + k // 2, k % 2]
            _line(figure.add_subplot(cell), table["time"], *panel)
    save(figure, png_path)


def _stack(axes, table: dict[str, np.ndarray]) -> None:
    """Masses in grams, stacked, under the line of what was emitted: the stack fills it exactly."""
    shown = [h for h in HOLDERS if np.nanmax(np.nan_to_num(table[h[0]])) > 0.0]
    grams = [1e3 * np.nan_to_num(table[name]) for name, _, _ in shown]
    if shown:
        axes.stackplot(table["time"], grams, labels=[h[1] for h in shown], colors=[h[2] for h in shown], linewidth=0)
    axes.plot(table["time"], 1e3 * table["emitted"], color="#222222", linewidth=1.2, label="emitted so far")
    worst, leaks = np.nanmax(np.abs(table["mass_error"]), initial=0.0), np.nansum(table["leaks"][-1:])
    axes.set_title(f"Where the water is   (mass error at most {worst:.1e}, leaks {leaks:.0f})")
    axes.set(xlabel="time [s]", ylabel="mass [g]", xlim=(table["time"][0], table["time"][-1]))
    axes.set_ylim(bottom=0.0)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="upper left", fontsize=9)


def _panels(table: dict[str, np.ndarray]) -> list[tuple]:
    """(title, values, unit, colour) of the small charts."""
    return [
        ("Fastest water or cloth", table["max_speed"], "m/s", "#3b6ea5"),
        ("Kinetic energy", 1e3 * table["kinetic_energy"], "mJ", "#5a5a8a"),
        ("Largest strain of the cloth", 1e2 * table["max_strain"], "%", "#b5532f"),
        ("Mean compression of the water", 1e2 * table["density_error"], "%", "#2f8f83"),
    ]


def _line(axes, time: np.ndarray, title: str, values: np.ndarray, unit: str, colour: str) -> None:
    axes.plot(time, values, color=colour, linewidth=1.3)
    axes.set_title(title)
    axes.set(xlabel="time [s]", ylabel=unit, xlim=(time[0], time[-1]))
    axes.set_ylim(bottom=min(0.0, np.nanmin(values)))
