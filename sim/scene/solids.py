"""[solid.*] -> primitives that water and cloth meet, and triangles that are drawn."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sim.scene import outline
from sim.scene.course import Course
from sim.scene.mesh import Grid, distance_grid, read_mesh
from sim.shapes import rotation

SHAPES = ("plane", "box", "sphere", "cylinder", "mesh")


class Primitive(NamedTuple):
    """A solid, or a wall of one, in axes of its own about its centre.

    shape     "plane": all that is below its own z = 0; "box", "sphere"; "cylinder": along its own z; "mesh": by `grid`
    centre    [m]; turn: (3, 3), columns are its own axes
    half      half of the smallest box round it, in its own axes [m]; of a plane nothing
    course    where it moves; None: it stands still. pivot: what it turns about [m]
    """

    solid: str
    shape: str
    centre: np.ndarray
    turn: np.ndarray
    half: np.ndarray
    friction: float
    course: Course | None
    pivot: np.ndarray
    grid: Grid | None

    def place(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """(centre, turn) at a time [s]."""
        if self.course is None:
            return self.centre, self.turn
        shift, angle = self.course.place(time)
        swing = np.array(rotation(self.course.axis, angle))
        return self.pivot + shift + swing @ (self.centre - self.pivot), swing @ self.turn

    def motion(self, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """(linear, angular) velocity that takes it from its place at one time to that at another [m/s], [1/s].

        A point x of it moves at linear + angular x (x - centre).
        """
        if self.course is None:
            return np.zeros(3), np.zeros(3)
        turned = self.course.place(end)[1] - self.course.place(begin)[1]
        moved = self.place(end)[0] - self.place(begin)[0]
        return moved / (end - begin), self.course.axis * (turned / (end - begin))

    def arm(self) -> float:
        """Farthest that a point of it can be from its pivot [m]."""
        return float(np.linalg.norm(self.centre - self.pivot) + np.linalg.norm(self.half))


@dataclass
class Solids:
    """primitives; drawn: of those that are seen, what is drawn, in its own axes; ground_z: highest floor or nan [m].

    triangles (r, 3): of what is drawn, into `corners`; the first `opaque` of them are no glass.
    """

    primitives: tuple[Primitive, ...]
    drawn: tuple[tuple[Primitive, outline.Outline], ...]
    opaque: int
    ground_z: float
    triangles: np.ndarray = field(init=False)

    def __post_init__(self):
        self.triangles = outline.join([shown for _, shown in self.drawn])[1]

    @property
    def moves(self) -> bool:
        """Whether any of them ever does."""
        return any(p.course for p in self.primitives)

    def corners(self, time: float) -> np.ndarray:
        """(s, 3) [m] of what is drawn, at a time [s]."""
        placed = [(shown[0], *primitive.place(time)) for primitive, shown in self.drawn]
        return np.concatenate([centre + x @ turn.T for x, centre, turn in placed]) if placed else np.zeros((0, 3))


def build_solids(solids: dict, spacing: float = 0.0) -> Solids:
    """From config.solid: named tables by shape. spacing [m]: what a mesh has to be resolved for. Basins are glass."""
    primitives, dense, glass, ground = [], [], [], [np.nan]
    for name, solid in solids.items():
        for shape, centre, turn, half, shown, grid in _parts(name, solid, spacing):
            course, pivot = _course(solid)
            made = Primitive(name, shape, np.array(centre, float), turn, half, solid.friction, course, pivot, grid)
            primitives.append(made)
            if shown:
                (glass if solid.shape == "basin" else dense).append((made, shown))
        if solid.shape == "plane" and primitives[-1].turn[2, 2] > 0.999:
            ground.append(float(solid.point[2]))
    opaque = sum(len(triangles) for _, (_, triangles) in dense)
    highest = float(np.nanmax(ground)) if len(ground) > 1 else np.nan
    return Solids(tuple(primitives), (*dense, *glass), opaque, highest)


def _course(solid) -> tuple[Course | None, np.ndarray]:
    """(its course, what it turns about)."""
    path = getattr(solid, "path", None)
    own = solid.point if solid.shape == "plane" else solid.centre
    return Course(path) if path else None, np.array(path.centre if path and path.centre else own, float)


def _parts(name: str, solid, spacing: float):
    """(shape, centre, turn, half, outline, grid) of each primitive that a solid is made of."""
    if solid.shape == "plane":
        return [("plane", solid.point, _upright(solid.normal), np.zeros(3), None, None)]
    if solid.shape == "sphere":
        return [("sphere", solid.centre, np.eye(3), np.full(3, solid.radius), outline.sphere(solid.radius), None)]
    if solid.shape == "cylinder":
        half = np.array([solid.radius, solid.radius, 0.5 * solid.length])
        drawn = outline.cylinder(solid.radius, half[2])
        return [("cylinder", solid.centre, _upright(solid.axis), half, drawn, None)]
    turn = getattr(solid, "turn", None)
    turn = np.array(rotation(turn.axis, turn.angle)) if turn else np.eye(3)
    if solid.shape == "mesh":
        return [_mesh(name, solid, turn, spacing)]
    boxes = [(np.zeros(3), solid.size)] if solid.shape == "box" else _basin_boxes(solid)
    halves = [(np.array(offset, float), 0.5 * np.array(size, float)) for offset, size in boxes]
    return [("box", solid.centre + turn @ at, turn, half, outline.box(half), None) for at, half in halves]


def _mesh(name: str, solid, turn: np.ndarray, spacing: float):
    """A mesh is kept about the middle of its box."""
    x, triangles = read_mesh(name, solid)
    middle = 0.5 * (x.min(0) + x.max(0))
    x = x - middle
    grid = distance_grid(name, x, triangles, spacing)
    return ("mesh", solid.centre + turn @ middle, turn, x.max(0), (x, triangles), grid)


def _upright(normal) -> np.ndarray:
    """Right-handed axes whose third is the normal, to the last bit."""
    n = np.array(normal, float) / np.linalg.norm(normal)
    u = np.cross([0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0], n)
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(n, u), n], 1)


def _basin_boxes(basin) -> list[tuple]:
    """Floor below z = 0 and four walls, each `thickness` thick; corners belong to the x walls."""
    (lx, ly, lz), t = basin.size, basin.thickness
    floor = ((0.0, 0.0, -t / 2), (lx + 2 * t, ly + 2 * t, t))
    walls = [((s * (lx + t) / 2, 0.0, lz / 2), (t, ly + 2 * t, lz)) for s in (-1, 1)]
    walls += [((0.0, s * (ly + t) / 2, lz / 2), (lx, t, lz)) for s in (-1, 1)]
    return [floor, *walls]
