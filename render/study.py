"""The picture of a study, drawn from its CSV and nothing else: error over time for each case, and what bounds hold."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from render.charts import STYLE, plt, read_rows, save
from sim.errors import RunError

COLOURS = ("#3b6ea5", "#b5532f", "#2f8f83", "#8a5aa0", "#c79a2b", "#5a5a5a")
MARKERS = ("o", "s", "D", "^", "v", "P")
COLUMNS = ("case", "method", "error", "bounds", "role", "front", "best", "failure")
"""Without which a CSV is no chart's."""
HELD, MISSED = "#2f8f83", "#c0392b"


def study_chart(csv_path: Path, png_path: Path) -> None:
    """Error over seconds per simulated second of each swept case, and every bound. RunError if unreadable."""
    rows = read_rows(csv_path, "chart", COLUMNS)
    cases = list(dict.fromkeys(r["case"] for r in rows if "sweep" in r["role"]))
    checks = [(r, *pair) for r in rows if r["bounds"] for pair in _held(r)]
    if not cases and not checks:
        raise RunError(f"{csv_path}: nothing in it to draw")
    high = math.ceil(len(cases) / 2)
    tall = [4.4 * high] * bool(cases) + [0.19 * len(checks) + 0.9] * bool(checks)
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(11.2, sum(tall)), layout="constrained")
        parts = figure.add_gridspec(len(tall), 1, height_ratios=tall)
        grid = parts[0].subgridspec(max(high, 1), min(len(cases), 2) or 1)
        methods = list(dict.fromkeys(r["method"] for r in rows))
        for k, case in enumerate(cases):
            axes = figure.add_subplot(grid[k // 2, k % 2])
            _sweep(axes, case, [r for r in rows if r["case"] == case and "sweep" in r["role"]], methods)
        if checks:
            _checks(figure.add_subplot(parts[-1]), checks)
        versions = len({r["version"] for r in rows})
        if versions > 1:
            figure.supxlabel(f"rows of {versions} versions: run the chart again for one", fontsize=8, color="#777777")
    save(figure, png_path)


def _number(row: dict[str, str], column: str) -> float:
    try:
        return float(row[column])
    except (KeyError, ValueError):
        return math.nan


def _held(row: dict[str, str]) -> list[tuple[str, float, float]]:
    """(figure, |value|, bound) of a row's bounds."""
    pairs = (text.split("<=") for text in row["bounds"].split())
    return [(figure, abs(_number(row, figure)), float(bound)) for figure, bound in pairs]


def _sweep(axes, case: str, rows: list[dict[str, str]], methods: list[str]) -> None:
    """A point a row: colour by method, shape by spacing; crosses above for what failed; the front as a staircase."""
    spacings = sorted({_number(r, "spacing") for r in rows}, reverse=True)
    fine = [r for r in rows if _number(r, "error") > 0.0]
    failed = [r for r in rows if r["failure"]]
    for row in fine:
        colour = COLOURS[methods.index(row["method"]) % len(COLOURS)]
        marker = MARKERS[spacings.index(_number(row, "spacing")) % len(MARKERS)]
        place = (_number(row, "seconds_per_simulated_second"), _number(row, "error"))
        axes.plot(*place, marker, color=colour, markersize=6.5, alpha=0.9, zorder=3)
        if row["report"]:
            axes.plot(*place, "o", markersize=13, markerfacecolor="none", markeredgecolor="#222222", zorder=4)
    axes.set(xscale="log", yscale="log", xlabel="seconds per simulated second", ylabel="error")
    axes.margins(0.1, 0.12)
    top = max([_number(r, "error") for r in fine], default=1.0) * 2.0
    for row in failed:
        colour = COLOURS[methods.index(row["method"]) % len(COLOURS)]
        seconds = _number(row, "seconds_per_simulated_second")
        axes.plot(seconds if seconds > 0.0 else 1.0, top, "x", color=colour, markersize=8, markeredgewidth=2)
    _front(axes, fine)
    _best(axes, fine)
    first = next((r["reference"] for r in rows if r.get("reference")), "")
    axes.set_title(f"{case.replace('_', ' ')}" + (f"   ({first})" if first else ""))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100.0 * value:g} %"))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        axis.set_minor_formatter(axis.get_major_formatter() if high < 20.0 * low else NullFormatter())
    axes.grid(True, which="minor", alpha=0.1)
    _legend(axes, rows, methods, spacings, bool(failed))


def _front(axes, rows: list[dict[str, str]]) -> None:
    """The points that nothing beats in both: a staircase."""
    front = sorted((_number(r, "seconds_per_simulated_second"), _number(r, "error")) for r in rows if r["front"] == "1")
    if front:
        axes.step(*zip(*front), where="post", color="#222222", linewidth=1.0, alpha=0.6, zorder=2)


def _best(axes, rows: list[dict[str, str]]) -> None:
    """The cheapest at each level, named."""
    for row in rows:
        if row["best"]:
            place = (_number(row, "seconds_per_simulated_second"), _number(row, "error"))
            words = "best at " + ", ".join(level.replace("%", " %") for level in row["best"].split())
            axes.annotate(words, place, (7, -13), textcoords="offset points", fontsize=8.5, zorder=5)


def _legend(axes, rows, methods: list[str], spacings: list[float], failed: bool) -> None:
    here = [m for m in methods if any(r["method"] == m for r in rows)]
    report = {r["method"] for r in rows if r["report"]}
    entries = [
        Line2D([], [], marker="o", linestyle="", color=COLOURS[methods.index(m) % len(COLOURS)], label=m)
        for m in here
        if m not in report
    ]
    entries += [
        Line2D(
            [],
            [],
            marker="o",
            linestyle="",
            markersize=11,
            markeredgecolor="#222222",
            markerfacecolor=COLOURS[methods.index(m) % len(COLOURS)],
            label=f"{m} (the report's)",
        )
        for m in here
        if m in report
    ]
    entries += [
        Line2D([], [], marker=MARKERS[k % len(MARKERS)], linestyle="", color="#999999", label=f"dx = {1e3 * s:.3g} mm")
        for k, s in enumerate(spacings)
    ]
    if failed:
        entries.append(Line2D([], [], marker="x", linestyle="", color="#555555", label="failed"))
    axes.legend(handles=entries, fontsize=8, loc="best")


def _checks(axes, checks: list[tuple]) -> None:
    """A bar a bound: the figure over it, to the line at 1."""
    shares = [value / bound if bound else 0.0 if value <= 0.0 else math.inf for _, _, value, bound in checks]
    least = 1e-2
    for k, ((row, _, value, bound), share) in enumerate(zip(checks, shares)):
        fine = share <= 1.0
        shown = min(max(share, 1.2 * least), 20.0) if math.isfinite(share) else 20.0
        axes.barh(k, shown - least, left=least, height=0.62, color=HELD if fine else MISSED, alpha=0.85)
        told = f"{value:.3g} of {bound:.3g}" if math.isfinite(value) else row["failure"][:60] or "not measured"
        axes.text(shown * 1.05, k, told, va="center", fontsize=7.5)
    axes.axvline(1.0, color="#222222", linewidth=1.0)
    labels = [f"{r['id']}  {r['method']}  {1e3 * _number(r, 'spacing'):.3g} mm: {f}" for r, f, _, _ in checks]
    axes.set_yticks(range(len(checks)), labels, fontsize=7.5)
    axes.set(xscale="log", xlim=(least, 40.0), ylim=(len(checks) - 0.4, -0.6), xlabel="figure / bound")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_title("What must hold: each figure over its bound")
    axes.grid(False, axis="y")
