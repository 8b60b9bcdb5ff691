"""[solid.*] -> primitives (planes, boxes, spheres) that water and cloth meet, and triangles that are drawn."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Primitive(NamedTuple):
    """shape "plane": a = point, b = normal; "box": a = centre, b = half size; "sphere": a = centre, b[0] = radius."""

    solid: str
    shape: str
    a: tuple[float, float, float]
    b: tuple[float, float, float]
    friction: float


@dataclass
class Solids:
    """primitives: tuple; x (s, 3) and triangles (r, 3) of what is drawn; ground_z: highest horizontal plane or nan."""

    primitives: tuple[Primitive, ...]
    x: np.ndarray
    triangles: np.ndarray
    ground_z: float


def build_solids(solids: dict) -> Solids:
    """From config.solid: named tables by shape. A basin is a floor and four walls round an inside of `size`."""
    primitives: list[Primitive] = []
    boxes: list[tuple] = []
    spheres: list[tuple] = []
    ground = [np.nan]
    for name, solid in solids.items():
        if solid.shape == "plane":
            normal = np.array(solid.normal, float) / np.linalg.norm(solid.normal)
            primitives.append(Primitive(name, "plane", tuple(solid.point), tuple(normal.tolist()), solid.friction))
            if normal[2] > 0.999:
                ground.append(float(solid.point[2]))
        elif solid.shape == "sphere":
            primitives.append(
                Primitive(name, "sphere", tuple(solid.centre), (float(solid.radius), 0.0, 0.0), solid.friction)
            )
            spheres.append((solid.centre, solid.radius))
        else:
            parts = [(solid.centre, solid.size)] if solid.shape == "box" else _basin_boxes(solid)
            for centre, size in parts:
                half = tuple(0.5 * s for s in size)
                primitives.append(Primitive(name, "box", tuple(centre), half, solid.friction))
                boxes.append((centre, half))
    meshes = [_box_mesh(*b) for b in boxes] + [_sphere_mesh(*s) for s in spheres]
    x, triangles = _join(meshes)
    return Solids(tuple(primitives), x, triangles, float(np.nanmax(ground)) if len(ground) > 1 else np.nan)


def _basin_boxes(basin) -> list[tuple]:
    """Floor below z = centre.z and four walls, each `thickness` thick; corners belong to the x walls."""
    (cx, cy, cz), (lx, ly, lz), t = basin.centre, basin.size, basin.thickness
    floor = ((cx, cy, cz - t / 2), (lx + 2 * t, ly + 2 * t, t))
    walls = [((cx + s * (lx + t) / 2, cy, cz + lz / 2), (t, ly + 2 * t, lz)) for s in (-1, 1)]
    walls += [((cx, cy + s * (ly + t) / 2, cz + lz / 2), (lx, t, lz)) for s in (-1, 1)]
    return [floor, *walls]


def _box_mesh(centre, half) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[i, j, k] for k in (-1, 1) for j in (-1, 1) for i in (-1, 1)], float)
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return np.asarray(centre) + corners * np.asarray(half), np.array(triangles)


def _sphere_mesh(centre, radius, rows: int = 24) -> tuple[np.ndarray, np.ndarray]:
    theta = np.linspace(0, np.pi, rows + 1)
    phi = np.linspace(0, 2 * np.pi, 2 * rows, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    unit = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], -1).reshape(-1, 3)
    n = len(phi)
    triangles = []
    for i in range(rows):
        for j in range(n):
            a, b, c, d = i * n + j, (i + 1) * n + j, (i + 1) * n + (j + 1) % n, i * n + (j + 1) % n
            triangles += [(a, b, c), (a, c, d)]
    return np.asarray(centre) + radius * unit, np.array(triangles)


def _join(meshes) -> tuple[np.ndarray, np.ndarray]:
    if not meshes:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    starts = np.cumsum([0] + [len(x) for x, _ in meshes[:-1]])
    x = np.concatenate([x for x, _ in meshes])
    return x, np.concatenate([t + s for (_, t), s in zip(meshes, starts)]).astype(np.int32)
