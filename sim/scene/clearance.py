"""How far points are from solids before anything moves."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sim.scene.solids import Primitive


def clearance(primitives: Iterable[Primitive], x: np.ndarray) -> np.ndarray:
    """Signed distance (n,) [m] of points (n, 3) to the nearest solid at t = 0; inf where there is none.

    Of a mesh, that of the nearest sample of its grid: half a cell off at most.
    """
    nearest = np.full(len(x), np.inf)
    for p in primitives:
        centre, turn = p.place(0.0)
        nearest = np.minimum(nearest, _distance(p, (x - centre) @ turn))
    return nearest


def _distance(p: Primitive, r: np.ndarray) -> np.ndarray:
    """At points in the solid's own axes."""
    if p.shape == "plane":
        return r[:, 2]
    if p.shape == "sphere":
        return np.linalg.norm(r, axis=1) - p.half[0]
    if p.shape == "mesh":
        at = np.rint((r - p.grid.low) / p.grid.cell).astype(int)
        inside = ((at >= 0) & (at < p.grid.distance.shape)).all(1)
        return np.where(inside, p.grid.distance[tuple(np.where(inside[:, None], at, 0).T)], np.inf)
    beyond = np.abs(r) - p.half
    if p.shape == "cylinder":
        beyond = np.stack([np.hypot(r[:, 0], r[:, 1]) - p.half[0], np.abs(r[:, 2]) - p.half[2]], 1)
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(1), 0.0)
