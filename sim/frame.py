"""What a picture needs: Static once a run, Frame once a frame; NumPy only, and all that render/ may import.

Files are .npz with one array a field; what is not modelled is None in memory and absent on disk.
"""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim.errors import RunError

SCHEMA = 1


@dataclass
class Static:
    """What does not change in a run. SI units.

    spacing            ()      fluid particle spacing [m] (0 without water)
    solid_x            (s, 3)  corners of solids that are drawn [m]; the ground plane is not among them
    solid_triangles    (r, 3)  i32 into solid_x
    solid_opaque       ()      i32, how many of them, the first ones, are no glass; absent = none
    cloth_triangles    (t, 3)  i32 into Frame.cloth_x
    cloth_uv           (n, 2)  material coordinates [m]
    cloth_thickness    ()      [m]
    cloth_colour       (3,)    dry, linear RGB in 0..1
    ground_z           ()      height of the horizontal ground [m]; nan without one
    fluid_absorption   (3,)    of red, green and blue light in the water [1/m]
    """

    spacing: np.ndarray
    ground_z: np.ndarray
    cloth_colour: np.ndarray
    solid_x: np.ndarray | None = None
    solid_triangles: np.ndarray | None = None
    solid_opaque: np.ndarray | None = None
    cloth_triangles: np.ndarray | None = None
    cloth_uv: np.ndarray | None = None
    cloth_thickness: np.ndarray | None = None
    fluid_absorption: np.ndarray | None = None


@dataclass
class Frame:
    """One snapshot. SI units; water rows are sorted by fluid_id.

    time               ()      [s]
    fluid_id           (n,)    i32
    fluid_x, fluid_v   (n, 3)  f32 [m], [m/s]
    fluid_mass         (n,)    f32 [kg]
    cloth_x, cloth_v   (m, 3)  f32 [m], [m/s]
    cloth_saturation   (m,)    f32, pore water over pore volume at each node, 0..1
    cloth_film         (m,)    f32, thickness of the film hanging below each node [m]
    solid_x            (s, 3)  f32, in place of Static.solid_x where a solid moves [m]
    """

    time: np.ndarray
    fluid_id: np.ndarray | None = None
    fluid_x: np.ndarray | None = None
    fluid_v: np.ndarray | None = None
    fluid_mass: np.ndarray | None = None
    cloth_x: np.ndarray | None = None
    cloth_v: np.ndarray | None = None
    cloth_saturation: np.ndarray | None = None
    cloth_film: np.ndarray | None = None
    solid_x: np.ndarray | None = None


def write(path: Path, snapshot: Static | Frame) -> None:
    """Write atomically: the file is whole or absent."""
    arrays = {k: v for k, v in dataclasses.asdict(snapshot).items() if v is not None}
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        with open(part, "wb") as file:
            np.savez(file, schema=np.int32(SCHEMA), **arrays)
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror}") from error


def read(path: Path, kind: type = Frame) -> Static | Frame:
    """Read what `write` wrote. RunError if absent, broken, or of a newer schema."""
    try:
        with np.load(path) as file:
            arrays = {k: file[k] for k in file.files}
    except (OSError, ValueError, EOFError) as error:
        raise RunError(f"{path}: not a readable frame file") from error
    schema = int(arrays.pop("schema", -1))
    if not 1 <= schema <= SCHEMA:
        raise RunError(f"{path}: schema {schema}; this program reads up to {SCHEMA}")
    known = {f.name for f in dataclasses.fields(kind)}
    return kind(**{k: v for k, v in arrays.items() if k in known})
