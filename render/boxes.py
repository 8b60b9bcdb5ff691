"""Boxes of a tree over a picture of the cloth, a panel a level."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.collections import LineCollection

from render.camera import lens, look_at
from render.charts import plt, save

PANELS = 6
EDGES = np.array([(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit])
"""Of a box, between corners numbered by the bits of their high coordinates."""


def boxes_picture(path: Path, picture: np.ndarray, look, png_path: Path) -> None:
    """Wire boxes of the .npz `path` (level, low, high) over the picture that `look` gave, for PANELS of its levels."""
    with np.load(path) as file:
        level, low, high = file["level"], file["low"], file["high"]
    shown = np.unique(np.linspace(0, level.max(), PANELS).round().astype(int))
    view, glass = look_at(look.eye, look.target), lens(look.size, look.fov)
    height, width = picture.shape[:2]
    figure, grid = plt.subplots(2, -(-len(shown) // 2), figsize=(10.5, 4.3), layout="constrained", squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for axes, n in zip(grid.flat, shown):
        here = level == n
        thin = min(1.0, (30.0 / np.count_nonzero(level == n)) ** 0.35)
        axes.imshow(picture)
        lines = _lines(low[here], high[here], view, glass)
        axes.add_collection(LineCollection(lines, colors="#101418", linewidths=0.9 * thin, alpha=thin))
        axes.set(xlim=(0, width), ylim=(height, 0))
        axes.set_title(f"level {n}: {here.sum():,} box{'es' if here.sum() > 1 else ''}", fontsize=9, loc="left")
    save(figure, png_path)


def _lines(low: np.ndarray, high: np.ndarray, view: np.ndarray, glass: np.ndarray) -> np.ndarray:
    """(12 k, 2, 2) pixels: the edges of k boxes, as the camera sees them."""
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    corners = np.where(bits, high[:, None], low[:, None])
    r = (corners - view[3]) @ view[:3].T
    at = glass[1:] + glass[0] * r[..., :2] * (1.0, -1.0) / np.maximum(r[..., 2:], 1e-6)
    return at[:, EDGES].reshape(-1, 2, 2)
