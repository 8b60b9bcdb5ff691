"""Searches over patches: what a step costs over water and cloth, drawn from two CSV files alone."""

from __future__ import annotations

from pathlib import Path

from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from render.charts import STYLE, plt, read_rows, save

COLOURS = {"brute": "#999999", "grid": "#3b6ea5", "bvh": "#b5532f", "lbvh": "#2f8f83"}
WORDS = {
    "brute": "brute: every pair",
    "grid": "grid: no tree",
    "bvh": "bvh: the report's, built each step",
    "lbvh": "lbvh: refitted",
}
MARKERS = {"path": "o", "end": "x", "reach": "^"}
ASKED = {
    "path": "asks with its path: misses nothing",
    "end": "asks where it ends, as the report's",
    "reach": "asks all about where it ends",
}


def search_chart(csv_path: Path, png_path: Path) -> None:
    """Per scene: cost of a step over the patches at the most water, and over the water at the most patches."""
    rows, fits = read_rows(csv_path), read_rows(csv_path.with_name(f"{csv_path.stem}-fits.csv"))
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(
            2, len(scenes), figsize=(3.3 * len(scenes), 7.2), layout="constrained", sharex="row", squeeze=False
        )
        for k, scene in enumerate(scenes):
            of_scene = [row for row in rows if row["scene"] == scene]
            for line, (over, fixed) in enumerate((("patches", "points"), ("points", "patches"))):
                _panel(grid[line][k], of_scene, over, fixed, scene if line == 0 else "")
        for line in (0, 1):
            grid[line][0].set_ylabel("refit and query of a step [ms of one core]")
        handles, labels = grid[0][0].get_legend_handles_labels()
        labels = [f"{WORDS.get(name, name)}   {_powers(fits, name)}" for name in labels]
        figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=9)
        figure.suptitle("Water meets cloth: n particles ask m patches", x=0.01, ha="left", fontsize=13, weight="bold")
    save(figure, png_path)


def _panel(axes, rows: list[dict[str, str]], over: str, fixed: str, title: str) -> None:
    most = max(int(row[fixed]) for row in rows)
    for name in COLOURS:
        chosen = [row for row in rows if row["search"] == name]
        at = most if name != "brute" else max((int(r[fixed]) for r in chosen), default=0)
        line = sorted((int(r[over]), 1e3 * float(r["total"])) for r in chosen if int(r[fixed]) == at)
        if name == "brute":  # not at the largest sizes: its longest line instead
            lines = {n: sorted((int(r[over]), 1e3 * float(r["total"])) for r in chosen if int(r[fixed]) == n)
                     for n in {int(r[fixed]) for r in chosen}}  # fmt: skip
            at, line = max(lines.items(), key=lambda item: (len(item[1]), item[0]))
            if at != most:
                axes.annotate(f"{at:,} {fixed}", line[-1], (4, -3), textcoords="offset points", fontsize=7.5,
                              color=COLOURS[name])  # fmt: skip
        axes.plot(*zip(*line), "o-", color=COLOURS[name], markersize=4.5, label=name)
    axes.set(xscale="log", yscale="log", xlabel=f"{over}, at {most:,} {fixed}")
    _plain(axes.xaxis)
    _plain(axes.yaxis)
    axes.set_title(title)


def _plain(axis) -> None:
    """Numbers on a log axis as they are read: 10,000, 20."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}" if value < 1e6 else f"{value:.0e}"))
    low, high = axis.get_view_interval()
    axis.set_minor_formatter(axis.get_major_formatter() if high < 8.0 * low else NullFormatter())


def _powers(fits: list[dict[str, str]], name: str) -> str:
    """As "query ~ n^1.0 m^0.2, refit ~ m^1.0"."""
    parts = []
    for fit in (f for f in fits if f["search"] == name and f["what"] in ("query", "refit")):
        points = f"n^{float(fit['of_points']):.2f} " if fit["of_points"] else ""
        parts.append(f"{fit['what']} ~ {points}m^{float(fit['of_patches']):.2f}")
    return ", ".join(parts)


def accuracy_chart(csv_path: Path, png_path: Path) -> None:
    """Per scene: crossings missed, and boxes tried in vain, over the time of a step, by search and way to ask."""
    rows = read_rows(csv_path)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    measures = (("missed", 100.0, "crossings missed [%]"), ("false", 1.0, "false candidates a particle"))
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(
            2, len(scenes), figsize=(3.3 * len(scenes), 6.4), layout="constrained", sharex="col", squeeze=False
        )
        for k, scene in enumerate(scenes):
            hits = next(row["hits"] for row in rows if row["scene"] == scene)
            for axes, (column, scale, label) in zip(grid[:, k], measures):
                for row in (row for row in rows if row["scene"] == scene):
                    axes.plot(
                        1e3 * float(row["seconds"]),
                        scale * float(row[column]),
                        MARKERS[row["asked"]],
                        color=COLOURS[row["search"]],
                        markersize=7.0,
                        alpha=0.85,
                    )
                axes.set_xscale("log")
                axes.set_ylabel(label if k == 0 else "")
            _plain(grid[1][k].xaxis)
            grid[0][k].set(ylim=(-1.0, None), title=f"{scene}   ({int(hits):,} crossings)")
            grid[1][k].set(xlabel="refit and query of a step [ms]", ylim=(0.0, None))
        shown = [name for name in COLOURS if any(row["search"] == name for row in rows)]
        entries = [Line2D([], [], marker="s", linestyle="", color=COLOURS[n], label=WORDS[n]) for n in shown]
        entries += [Line2D([], [], marker=m, linestyle="", color="#555555", label=ASKED[n]) for n, m in MARKERS.items()]
        figure.legend(handles=entries, loc="outside lower center", ncols=3, fontsize=9)
        first = rows[0]
        figure.suptitle(
            f"Speed against accuracy: {int(first['points']):,} particles, {int(first['patches']):,} patches",
            x=0.01,
            ha="left",
            fontsize=13,
            weight="bold",
        )
    save(figure, png_path)
