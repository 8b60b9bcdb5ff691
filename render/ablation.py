"""One page on why a scene fails: its causes mended, and left in, one at a time. Drawn from two CSV files alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from render.charts import STYLE, plt, read_rows, save

FAILS, HOLDS, WATER = "#b5532f", "#3b6ea5", "#7fb2d6"
MEASURES = {
    "imploding": ("density", "density_bound", "Mean density at its worst [rest density]"),
    "exploding": ("mean_speed", "speed_bound", "Speed at its worst, rms of all water [m/s]"),
}


def ablation_chart(csv_path: Path, places_path: Path, png_path: Path) -> None:
    """Where the water is, as the scene has it and all mended; and each cause mended, or left in, alone."""
    rows, places = (read_rows(path, "trials", ["run"]) for path in (csv_path, places_path))
    first = rows[0]
    column, bound, label = MEASURES.get(first["failure"], MEASURES["exploding"])
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(10.0, 8.6), layout="constrained")
        figure.suptitle(_headline(rows), x=0.01, ha="left", fontsize=13, fontweight="bold")
        grid = figure.add_gridspec(2, 2, height_ratios=[1.15, 1.0])
        ends = [[p for p in places if p["run"] == run] for run in ("as it is", "all mended")]
        box = _box(places)
        for k, (end, title) in enumerate(zip(ends, ("As the report had it", "All five mended"))):
            _side(figure.add_subplot(grid[0, k]), end, box, f"{title}, at {float(end[0]['time']):.3g} s")
        shared = None
        groups = (("as it is", "mended alone", "As the report had it, and one mended"),
                  ("all mended", "left alone", "All mended, and one left in"))  # fmt: skip
        for k, (base, run, title) in enumerate(groups):
            axes = shared = figure.add_subplot(grid[1, k], sharex=shared)
            chosen = [r for r in rows if r["run"] in (base, run)]
            nothing = "nothing mended" if k == 0 else "nothing left"
            _bars(axes, chosen, column, float(first[bound]), nothing, title)
            axes.set_xlabel(label)
    save(figure, png_path)


def _headline(rows: list[dict[str, str]]) -> str:
    failure = {"exploding": "explode", "imploding": "implode"}.get(rows[0]["failure"], "fail")
    if not rows[0]["failure"]:
        return "This water holds"
    cured = [r["words"] for r in rows if r["run"] == "mended alone" and not r["failure"]]
    if not cured:
        return f"Why does this water {failure}? No single cause: mending one is not enough"
    return f"Why does this water {failure}? The {' or the '.join(cured)}: mended alone, it holds"


def _side(axes, places: list[dict[str, str]], box: tuple, title: str) -> None:
    """The water from the side, x across and z up [cm]."""
    x, z = (100.0 * np.array([float(p[n]) for p in places]) for n in "xz")
    axes.scatter(x, z, s=14, color=WATER, edgecolors="#2f6f9f", linewidths=0.4)
    axes.set_title(title)
    axes.set(xlabel="x [cm]", ylabel="z [cm]", xlim=box[0], ylim=box[1], aspect="equal")


def _box(places: list[dict[str, str]]) -> tuple:
    x, z = (100.0 * np.array([float(p[n]) for p in places]) for n in "xz")
    half, top = 1.05 * np.abs(x).max(), 1.05 * max(z.max(), 0.6 * np.abs(x).max())
    return (-half, half), (-0.05 * top, top)


def _bars(axes, rows: list[dict[str, str]], column: str, bound: float, nothing: str, title: str) -> None:
    values = [float(r[column]) for r in rows]
    colours = [FAILS if r["failure"] else HOLDS for r in rows]
    names = [r["words"] or nothing for r in rows]
    places = np.arange(len(rows))[::-1]
    axes.barh(places, values, color=colours, height=0.62)
    for place, value, row in zip(places, values, rows):
        words = f"{row['failure']} at {float(row['time']):.3f} s" if row["failure"] else "holds"
        axes.annotate(
            words,
            (max(value, bound) if value > 0.5 * bound else value, place),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
        )
    axes.axvline(bound, color="#444444", linewidth=0.9, linestyle="--")
    axes.annotate("no longer physics", (bound, 1.0), (4, -2), xycoords=("data", "axes fraction"),
                  textcoords="offset points", va="top", fontsize=8, color="#444444")  # fmt: skip
    axes.set_yticks(places, names)
    axes.set_ylim(-0.6, len(rows) - 0.2)
    axes.set_title(title)
    axes.grid(axis="y", visible=False)
    axes.set_xlim(0.0, max(axes.get_xlim()[1], 1.45 * max(values), 1.2 * bound))
