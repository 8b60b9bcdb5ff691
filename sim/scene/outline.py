"""Triangles by which solids are drawn."""

import numpy as np

Outline = tuple[np.ndarray, np.ndarray]
"""x (n, 3) about the solid's own centre [m], triangles (m, 3) seen counterclockwise from outside."""


def box(half) -> Outline:
    """Twelve triangles."""
    corners = np.array([[i, j, k] for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)], float)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return corners * np.asarray(half), np.array(triangles)


def sphere(radius: float, rows: int = 24) -> Outline:
    """A globe of meridians and parallels."""
    theta = np.linspace(0, np.pi, rows + 1)
    phi = np.linspace(0, 2 * np.pi, 2 * rows, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    return radius * unit, _strips(rows, len(phi))


def cylinder(radius: float, half: float, sides: int = 48) -> Outline:
    """Upright: two fans of triangles and a wall between them; the corners of the fans are their own, so edges stay."""
    phi = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([radius * np.cos(phi), radius * np.sin(phi), np.zeros(sides)], 1)
    up = np.array([0.0, 0.0, half])
    x = np.concatenate([np.tile(up, (sides, 1)), ring + up, ring - up, np.tile(-up, (sides, 1))])
    return x, _strips(3, sides)


def _strips(rows: int, around: int) -> np.ndarray:
    """Two triangles for each quad between rings of `around` points, the first ring on top."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rows), np.arange(around), indexing="ij"))
    right = (j + 1) % around
    a, b, c, d = i * around + j, (i + 1) * around + j, (i + 1) * around + right, i * around + right
    return np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], 1).reshape(-1, 3)


def join(outlines: list[Outline]) -> Outline:
    """One list of corners, one of triangles."""
    if not outlines:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    starts = np.cumsum([0] + [len(x) for x, _ in outlines[:-1]])
    x = np.concatenate([x for x, _ in outlines])
    return x, np.concatenate([t + s for (_, t), s in zip(outlines, starts)]).astype(np.int32)
