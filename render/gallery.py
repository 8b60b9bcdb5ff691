"""Pictures side by side, each with a line below it."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from render.charts import save
from render.draw import Look, draw
from sim.frame import Frame, Static

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402  (the backend must be chosen first: there may be no display)

WIDTH, LINES = 2.25, 0.45
"""[inch] Of a picture, and of the two lines of text below it."""


def portrait(frame: Frame, static: Static) -> np.ndarray:
    """A cloth over the gallery's pedestal, uint8 (h, w, 3)."""
    return draw(frame, Look(size=(640, 600), eye=(0.46, -0.52, 0.50), target=(0.0, 0.0, 0.22)), static)


def side_by_side(pictures: list[tuple[str, np.ndarray]], path: Path) -> None:
    """One row of (text, uint8 (h, w, 3)), written as a PNG of 100 pixels an inch."""
    tall, wide = pictures[0][1].shape[:2]
    height = WIDTH * tall / wide
    figure, axes = plt.subplots(1, len(pictures), figsize=(WIDTH * len(pictures), height + LINES), dpi=100)
    for axis, (text, pixels) in zip(np.atleast_1d(axes), pictures):
        axis.imshow(pixels, interpolation="antialiased")
        axis.set_axis_off()
        axis.text(0.5, -0.03, text, transform=axis.transAxes, ha="center", va="top", fontsize=7)
    share = LINES / (height + LINES)
    figure.subplots_adjust(left=0.0, right=1.0, top=1.0, bottom=share, wspace=0.01)
    save(figure, path)
