"""[solid.NAME]: every shape, where it stands, and the path on which it moves."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from sim.model import REQUIRED, Model, fault, option, quantity

Vector = tuple[float, float, float]


def nonzero(value: Vector) -> Vector:
    """A direction: any length but none."""
    if not any(value):
        raise fault("must not be the zero vector")
    return value


class Turn(Model):
    """[solid.NAME] turn: by `angle` about `axis` through the solid's own centre, by the right hand."""

    axis: Vector = quantity((0.0, 0.0, 1.0), why="up")
    angle: float = quantity(REQUIRED, "angle")

    _axis = field_validator("axis")(nonzero)


class Path(Model):
    """[solid.NAME] path: where the solid is at `times`, smoothly between them; before and after, it stands still.

    shift   from its place in the scene [m]; angle   about `axis` through `centre` [rad], which is shifted with it
    """

    times: tuple[float, ...] = quantity(REQUIRED, "time", ge=0)
    shift: tuple[Vector, ...] | None = quantity(None, "length", why="absent = it stays")
    angle: tuple[float, ...] | None = quantity(None, "angle", why="absent = it does not turn")
    axis: Vector = quantity((0.0, 0.0, 1.0), why="up")
    centre: Vector | None = quantity(None, "length", why="absent = the solid's own")
    repeat: bool = option(False, why="begin again after the last time; angles go on from where they are")

    _axis = field_validator("axis")(nonzero)

    @property
    def top_speed(self) -> float:
        """Of the shift, from rest to rest between two entries: 3/2 of the mean speed [m/s]."""
        if self.shift is None:
            return 0.0
        ways = [math.dist(a, b) for a, b in zip(self.shift, self.shift[1:])]
        return max(1.5 * way / (b - a) for way, a, b in zip(ways, self.times, self.times[1:]))

    @model_validator(mode="after")
    def _fits(self) -> Path:
        if len(self.times) < 2 or any(a >= b for a, b in zip(self.times, self.times[1:])):
            raise fault("times must be two or more, each later than the one before")
        if self.shift is None and self.angle is None:
            raise fault("needs shift or angle, one entry a time")
        for name in ("shift", "angle"):
            if getattr(self, name) is not None and len(getattr(self, name)) != len(self.times):
                raise fault(f"{name} has {len(getattr(self, name))} entries for {len(self.times)} times")
        if self.repeat and self.shift and self.shift[0] != self.shift[-1]:
            raise fault("repeat needs a shift that ends where it began")
        return self


class Solid(Model):
    """What every solid may have."""

    friction: float = quantity(0.0, ge=0)
    no_slip: bool = option(False, why="what is thinner than a particle slips; true: water at it moves with it")
    slide: Vector = quantity((0.0, 0.0, 0.0), "speed", why="at rest; its surface runs like a belt, with no_slip")
    path: Path | None = Field(None, description="absent = it stands still")

    @model_validator(mode="after")
    def _held(self) -> Solid:
        if any(self.slide) and not self.no_slip:
            raise fault("slide needs no_slip = true")
        return self


class Plane(Solid):
    """[solid.NAME] shape = "plane": everything below it is solid."""

    shape: Literal["plane"]
    point: Vector = quantity((0.0, 0.0, 0.0), "length")
    normal: Vector = quantity((0.0, 0.0, 1.0), why="up")

    _nonzero = field_validator("normal")(nonzero)


class Box(Solid):
    """[solid.NAME] shape = "box": along the axes, then turned."""

    shape: Literal["box"]
    centre: Vector = quantity(REQUIRED, "length")
    size: Vector = quantity(REQUIRED, "length", gt=0, le=1e6)
    turn: Turn | None = None


class Sphere(Solid):
    """[solid.NAME] shape = "sphere"."""

    shape: Literal["sphere"]
    centre: Vector = quantity(REQUIRED, "length")
    radius: float = quantity(REQUIRED, "length", gt=0, le=1e6)


class Cylinder(Solid):
    """[solid.NAME] shape = "cylinder": with flat ends, `length` long along `axis`."""

    shape: Literal["cylinder"]
    centre: Vector = quantity(REQUIRED, "length")
    radius: float = quantity(REQUIRED, "length", gt=0, le=1e6)
    length: float = quantity(REQUIRED, "length", gt=0, le=1e6)
    axis: Vector = quantity((0.0, 0.0, 1.0), why="upright")

    _nonzero = field_validator("axis")(nonzero)


class Mesh(Solid):
    """[solid.NAME] shape = "mesh": a closed triangle mesh, OBJ or PLY; its own origin comes to `centre`."""

    shape: Literal["mesh"]
    file: str = option(REQUIRED, why="beside the scene, or in configs/meshes")
    scale: float = quantity(1.0, gt=0, le=1e6, why="metres to a unit of the file")
    centre: Vector = quantity((0.0, 0.0, 0.0), "length")
    turn: Turn | None = None
    digest: str = option("", why="sha256 of the file; filled in by loading")
    found: str = Field("", exclude=True, json_schema_extra={"derived": True})


class Basin(Solid):
    """[solid.NAME] shape = "basin": an open box; `centre` is the middle of its inner floor, `size` its inside."""

    shape: Literal["basin"]
    centre: Vector = quantity((0.0, 0.0, 0.0), "length")
    size: Vector = quantity(REQUIRED, "length", gt=0, le=1e6)
    thickness: float = quantity("4 mm", "length", gt=0, le=1e6)
    turn: Turn | None = None


def _shape(table: Any) -> Any:
    return table.get("shape") if isinstance(table, dict) else getattr(table, "shape", None)


SHAPES = {"plane": Plane, "box": Box, "sphere": Sphere, "cylinder": Cylinder, "basin": Basin, "mesh": Mesh}
"""By the name that a scene gives."""

AnySolid = Annotated[
    Annotated[Plane, Tag("plane")]
    | Annotated[Box, Tag("box")]
    | Annotated[Sphere, Tag("sphere")]
    | Annotated[Cylinder, Tag("cylinder")]
    | Annotated[Basin, Tag("basin")]
    | Annotated[Mesh, Tag("mesh")],
    Discriminator(_shape),
]
"""The model of a [solid.NAME], by its shape."""


def rotation(axis: Vector, angle: float) -> tuple[Vector, Vector, Vector]:
    """Rows of the matrix that turns by `angle` about `axis`, by the right hand (Rodrigues)."""
    length = math.hypot(*axis)
    x, y, z = (a / length for a in axis)
    c, s = math.cos(angle), math.sin(angle)
    k = 1.0 - c
    return (
        (c + k * x * x, k * x * y - s * z, k * x * z + s * y),
        (k * x * y + s * z, c + k * y * y, k * y * z - s * x),
        (k * x * z - s * y, k * y * z + s * x, c + k * z * z),
    )
