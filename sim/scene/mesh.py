"""Closed triangle meshes: read, checked, and turned into a grid of signed distances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.errors import CapacityError, ConfigError

BAND = 2.5
"""[dx] Distances are kept up to here on both sides, and constant beyond; water at support 4 feels walls 2.2 dx away."""
SAMPLES_MAX = 1 << 24
"""Of one mesh: 64 MB."""
BATCH = 1 << 18
"""Pairs of triangle and sample worked on at a time: some 100 MB."""


@dataclass(frozen=True)
class Grid:
    """Signed distance [m], negative inside, at low + cell (i, j, k): `distance` (ni, nj, nk), f32."""

    low: np.ndarray
    cell: float
    distance: np.ndarray


def read_mesh(name: str, solid: Any) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) [m] about the mesh's own origin, triangles (m, 3) counterclockwise from outside.

    ConfigError where the file is no triangle mesh, or open, or its triangles do not all face the same way round.
    """
    import trimesh

    key = f"solid.{name}.file = {solid.file!r}".replace("'", '"')
    try:
        mesh = trimesh.load_mesh(solid.found)
    except Exception as error:  # a reader of files that others wrote: whatever it raises, the file is at fault
        raise ConfigError(f"{key}: cannot be read as a mesh: {' '.join(str(error).split())[:80]}") from error
    if not len(getattr(mesh, "faces", ())):
        raise ConfigError(f"{key}: holds no triangles")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    if not mesh.is_watertight:
        raise ConfigError(f"{key}: open: {_open_edges(mesh.faces)} edges have not two triangles; close the mesh")
    if not mesh.is_winding_consistent:
        raise ConfigError(f"{key}: its triangles do not all face outwards; make the normals consistent")
    x, triangles = np.array(mesh.vertices, float) * solid.scale, np.array(mesh.faces)
    return x, triangles if mesh.volume > 0.0 else triangles[:, ::-1]


def _open_edges(faces: np.ndarray) -> int:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return int((np.unique(edges, axis=0, return_counts=True)[1] != 2).sum())


def distance_grid(name: str, x: np.ndarray, triangles: np.ndarray, spacing: float) -> Grid:
    """Samples half a spacing apart (a whole one for a large mesh), BAND spacings beyond the mesh on every side."""
    band = BAND * spacing
    for cell in (0.5 * spacing, spacing):
        low = x.min(0) - band - cell
        shape = np.ceil((x.max(0) + band + cell - low) / cell) + 1
        if shape.prod() <= SAMPLES_MAX:
            break
    else:
        raise CapacityError(
            f"solid.{name}: {shape.prod():.3g} distances to keep; use a larger spacing or a smaller mesh"
        )
    shape = shape.astype(int)
    distance = _spread(*_touching(x[triangles], low, cell, shape), x[triangles], low, cell, band)
    return Grid(low, cell, np.where(_inside(x, triangles, low, cell, shape), -distance, distance).astype(np.float32))


def _touching(corners: np.ndarray, low: np.ndarray, cell: float, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(distance, nearest triangle or -1) of the samples less than a cell from a triangle's box; inf elsewhere."""
    distance, nearest = np.full(shape.prod(), np.inf), np.full(shape.prod(), -1)
    for t, place in _boxes(corners.min(1) - cell, corners.max(1) + cell, low, cell, shape):
        at = np.ravel_multi_index(tuple(place.T), shape)
        found = _distance(low + cell * place, corners[t])
        _keep_nearest(distance, nearest, at, found, t)
    return distance.reshape(shape), nearest.reshape(shape)


def _keep_nearest(distance, nearest, at, found, t) -> None:
    """Of several triangles at a sample the nearest, of those the first."""
    order = np.lexsort((t, found, at))
    at, found, t = at[order], found[order], t[order]
    first = np.r_[True, at[1:] != at[:-1]]
    at, found, t = at[first], found[first], t[first]
    better = found < distance[at]
    distance[at[better]], nearest[at[better]] = found[better], t[better]


def _spread(distance, nearest, corners, low, cell, band) -> np.ndarray:
    """Samples within the band tell their 26 neighbours which triangle is near, until no one gains.

    Danielsson 1980, with triangles for points; what is farther than the band counts as the band.
    """
    fresh = nearest >= 0
    while fresh.any():
        gained = np.zeros_like(fresh)
        for way in np.ndindex(3, 3, 3):
            source = tuple(slice(max(1 - w, 0), n - max(w - 1, 0)) for w, n in zip(way, fresh.shape))
            target = tuple(slice(max(w - 1, 0), n - max(1 - w, 0)) for w, n in zip(way, fresh.shape))
            told = fresh[source] & (nearest[source] != nearest[target]) & (distance[source] < band)
            t = nearest[source][told]
            place = np.argwhere(told) + [s.start for s in target]
            found = _distance(low + cell * place, corners[t])
            better = found < distance[tuple(place.T)]
            at = tuple(place[better].T)
            distance[at], nearest[at], gained[at] = found[better], t[better], True
        fresh = gained
    return np.minimum(distance, band)


def _boxes(begin: np.ndarray, end: np.ndarray, low: np.ndarray, cell: float, shape: np.ndarray):
    """(boxes (p,), places (p, d)): the lattice places from begin (m, d) to end [m] of every box, in batches."""
    first = np.maximum(np.ceil((begin - low) / cell).astype(int), 0)
    last = np.minimum(np.floor((end - low) / cell).astype(int), shape - 1)
    extent = np.maximum(last - first + 1, 0)
    counts = extent.prod(1)
    ends = np.cumsum(counts)
    for start in range(0, int(ends[-1]), BATCH):
        rest = np.arange(start, min(start + BATCH, int(ends[-1])))
        t = np.searchsorted(ends, rest, side="right")
        rest = rest - (ends[t] - counts[t])
        place = np.empty((len(rest), len(shape)), int)
        for d in range(len(shape))[::-1]:
            rest, place[:, d] = np.divmod(rest, extent[t, d])
        yield t, first[t] + place


def _distance(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Of points (n, 3) to triangles (n, 3, 3): to the plane where its foot is inside, else to the nearest edge."""
    p, (a, b, c) = np.ascontiguousarray(p.T), np.ascontiguousarray(corners.transpose(1, 2, 0))
    normal = _cross(b - a, c - a)
    length = np.sqrt(_dot(normal, normal))
    over = length > 0.0
    nearest_sq = np.full(p.shape[1], np.inf)
    for u, v in ((a, b), (b, c), (c, a)):
        edge, to = v - u, p - u
        over &= _dot(_cross(normal, edge), to) >= 0.0
        to -= np.clip(_dot(to, edge) / np.maximum(_dot(edge, edge), 1e-300), 0.0, 1.0) * edge
        nearest_sq = np.minimum(nearest_sq, _dot(to, to))
    plane = np.abs(_dot(p - a, normal)) / np.maximum(length, 1e-300)
    return np.where(over, plane, np.sqrt(nearest_sq))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _inside(x, triangles, low, cell, shape) -> np.ndarray:
    """Winding number of each sample != 0: crossings of its column (along z) with the mesh below it, by their sense.

    Edges are tested with their ends in one order, and a column on an edge belongs to one side of it, so two triangles
    that share an edge never both take a column, nor both leave it.
    """
    crossings = np.zeros(shape, np.int32)
    corners = x[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = corners[:, :, :2]
    for t, place in _boxes(flat.min(1), flat.max(1), low[:2], cell, shape[:2]):
        p = low[:2] + cell * place
        sides = np.stack([_side(x, triangles[t, k], triangles[t, (k + 1) % 3], p) for k in range(3)])
        hit = np.abs(sides.sum(0)) == 3
        t, place, p, sense = t[hit], place[hit], p[hit], sides[0, hit]
        steep = np.where(normal[t, 2] == 0.0, np.inf, normal[t, 2])
        z = corners[t, 0, 2] - ((p - corners[t, 0, :2]) * normal[t, :2]).sum(1) / steep
        k = np.clip(np.ceil((z - low[2]) / cell).astype(int), 0, shape[2] - 1)
        np.add.at(crossings, (place[:, 0], place[:, 1], k), -sense)
    return np.cumsum(crossings, axis=2) != 0


def _side(x: np.ndarray, a: np.ndarray, b: np.ndarray, place: np.ndarray) -> np.ndarray:
    """+1 where a place (n, 2) is left of the edge from corner a to b, seen from above, -1 right of it."""
    p, q = x[np.minimum(a, b), :2], x[np.maximum(a, b), :2]
    area = (q[:, 0] - p[:, 0]) * (place[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (place[:, 0] - p[:, 0])
    return np.where((area >= 0.0) == (a < b), 1, -1)
