"""Narrow phases: wrong answers over the time of one, drawn from narrow.csv alone."""

from pathlib import Path

from matplotlib.lines import Line2D

from render.charts import STYLE, plt, read_rows, save

COLOURS = {"ccd": "#3b6ea5", "plane_reflect": "#b5532f"}
MARKERS = ("o", "s", "^", "D", "v", "P")
FILLS = {"f32": "full", "f64": "none"}
PANELS = (("missed", "hits", "Hits missed [%]"), ("false", "misses", "Hits seen where none is [%]"))


def narrow_chart(csv_path: Path, png_path: Path) -> None:
    """Two panels: share of the true hits that is missed, share of the true misses that is seen as a hit."""
    rows = read_rows(csv_path, "queries", ["missed", "false", "nanoseconds"])
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    markers = dict(zip(kinds, MARKERS))
    ways = list(dict.fromkeys((row["phase"], row["precision"]) for row in rows))
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 2, figsize=(9.6, 4.4), layout="constrained", sharex=True)
        for axes, (wrong, among, label) in zip(panels, PANELS):
            for row in rows:
                hits = int(row["hits"])
                whole = hits if among == "hits" else int(row["queries"]) - hits
                axes.plot(
                    float(row["nanoseconds"]),
                    100.0 * int(row[wrong]) / max(whole, 1),
                    markers[row["kind"]],
                    color=COLOURS.get(row["phase"], "#777777"),
                    fillstyle=FILLS[row["precision"]],
                    markersize=7.0 if row["precision"] == "f32" else 11.0,
                )
            axes.set(xscale="log", xlabel="Time of a query [ns of one core]", ylabel=label, ylim=(-3.0, None))
        entries = [
            Line2D([], [], marker="o", ls="", color=COLOURS.get(p, "#777777"), fillstyle=FILLS[f], label=f"{p} {f}")
            for p, f in ways
        ]
        entries += [Line2D([], [], marker=markers[k], linestyle="", color="#555555", label=k) for k in kinds]
        figure.legend(handles=entries, loc="outside lower center", ncols=5, fontsize=9)
        figure.suptitle(_headline(rows), x=0.01, ha="left", fontsize=13, fontweight="bold")
        save(figure, png_path)


def _headline(rows: list[dict[str, str]]) -> str:
    told = []
    for phase in dict.fromkeys(row["phase"] for row in rows):
        mine = [row for row in rows if row["phase"] == phase]
        missed, hits = (sum(int(row[key]) for row in mine) for key in ("missed", "hits"))
        told.append(f"{phase} {100.0 * missed / max(hits, 1):.3g} %")
    return "Does a point meet a triangle?   Hits missed: " + ", ".join(told)
