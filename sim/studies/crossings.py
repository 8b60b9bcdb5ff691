"""Whether a sheet pierces itself: every edge against every triangle, in NumPy and f64, apart from what simulates it."""

import numpy as np

CHUNK = 256
"""Edges looked at together: 256 x 20,000 comparisons fit into the cache's neighbourhood."""


def crossings(x: np.ndarray, triangles: np.ndarray) -> int:
    """How many edges pierce a triangle that shares no node with them. x (n, 3) [m], triangles (t, 3)."""
    x, t = np.asarray(x, np.float64), np.asarray(triangles)
    edges = np.unique(np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]]), 1), axis=0)
    edges = edges[np.argsort(x[edges, 0].min(1), kind="stable")]
    low, high = x[t].min(1), x[t].max(1)
    found = 0
    for first in range(0, len(edges), CHUNK):  # a slab of them, and the triangles that reach into it
        slab = edges[first : first + CHUNK]
        near = (high[:, 0] >= x[slab, 0].min()) & (low[:, 0] <= x[slab, 0].max())
        found += _pierced(x, slab, t[near], low[near], high[near])
    return found


def _pierced(x: np.ndarray, edges: np.ndarray, t: np.ndarray, low: np.ndarray, high: np.ndarray) -> int:
    edge_low, edge_high = x[edges].min(1), x[edges].max(1)
    near = np.ones((len(edges), len(t)), bool)
    for d in range(3):
        near &= edge_low[:, None, d] <= high[None, :, d]
        near &= edge_high[:, None, d] >= low[None, :, d]
    e, f = np.nonzero(near)
    apart = (edges[e][:, :, None] != t[f][:, None, :]).all((1, 2))
    e, f = edges[e[apart]], t[f[apart]]
    p, q = x[e[:, 0]], x[e[:, 1]]
    a, b, c = (x[f[:, k]] for k in range(3))
    sides = np.sign(_volume(a, b, c, p)) * np.sign(_volume(a, b, c, q)) < 0
    round_it = np.stack([_volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)])
    return int((sides & ((round_it > 0).all(0) | (round_it < 0).all(0))).sum())


def _volume(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Six times the signed volume of tetrahedra."""
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)
