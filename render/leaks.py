"""Where water gets through cloth: a panel for each contact and sheet, drawn from leaks.csv alone."""

from pathlib import Path

import matplotlib
import numpy as np

from render.charts import STYLE, plt, read_rows, save

HOLDS = "#3b6ea5"
LEAKS = matplotlib.colormaps["YlOrRd"]
ORDER = ("ccd", "plane_reflect")
NAMES = {"plane_reflect": "plane_reflect, the report's"}


def leak_chart(csv_path: Path, png_path: Path) -> None:
    """Speed across, step up; in each cell a mark a thickness, thinnest lowest: blue where nothing crossed."""
    rows = read_rows(csv_path, "throws", ["leaks"])
    contacts = sorted({r["contact"] for r in rows}, key=lambda name: (name not in ORDER, name))
    cloths = list(dict.fromkeys(r["cloth"] for r in rows))
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            len(contacts), len(cloths), figsize=(3.4 * len(cloths) + 0.8, 3.1 * len(contacts) + 0.5),
            sharex=True, sharey=True, squeeze=False, layout="constrained",
        )  # fmt: skip
        figure.suptitle(_headline(rows, contacts), x=0.01, ha="left", fontsize=13, fontweight="bold")
        for contact, line in zip(contacts, panels):
            for cloth, axes in zip(cloths, line):
                _panel(axes, rows, contact, cloth)
            line[0].set_ylabel("Time step [ms]")
        for axes in panels[-1]:
            axes.set_xlabel("Speed [m/s]")
        thicknesses = sorted({float(r["thickness"]) for r in rows})
        words = ", ".join(f"{1e3 * t:g}" for t in thicknesses)
        figure.supxlabel(f"In each cell, from below: cloth {words} mm thick", fontsize=9, x=0.01, ha="left")
        scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0.0, 1.0), LEAKS)
        figure.colorbar(scale, ax=panels, label="Crossings a particle (blue: none)", shrink=0.6, pad=0.02)
        save(figure, png_path)


def _headline(rows: list[dict[str, str]], contacts: list[str]) -> str:
    told = []
    for contact in contacts:
        mine = [r for r in rows if r["contact"] == contact]
        told.append(f"{contact} leaks in {sum(r['leaks'] != '0' for r in mine)} of {len(mine)} throws")
    return "; ".join(told)


def _panel(axes, rows: list[dict[str, str]], contact: str, cloth: str) -> None:
    speeds, steps, thicknesses = (sorted({float(r[n]) for r in rows}) for n in ("speed", "dt", "thickness"))
    mine = [r for r in rows if (r["contact"], r["cloth"]) == (contact, cloth)]
    high = 0.8 / len(thicknesses)
    x = np.array([speeds.index(float(r["speed"])) for r in mine])
    y = np.array([steps.index(float(r["dt"])) - 0.4 + high * thicknesses.index(float(r["thickness"])) for r in mine])
    share = np.array([int(r["leaks"]) / max(int(r["particles"]), 1) for r in mine])
    colours = [HOLDS if s == 0.0 else LEAKS(0.15 + 0.85 * min(s, 1.0)) for s in share]
    axes.bar(x, 0.9 * high, width=0.84, bottom=y, color=colours)
    axes.set_xticks(range(len(speeds)), [f"{s:g}" for s in speeds])
    axes.set_yticks(range(len(steps)), [f"{1e3 * s:g}" for s in steps])
    axes.set_title(f"{NAMES.get(contact, contact)}: {cloth} sheet", fontsize=10)
    axes.grid(visible=False)
    axes.set_ylim(-0.5, len(steps) - 0.5)
