"""draw(frame, look, static) -> uint8 picture: what the rest of Seep calls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import taichi as ti

from render import image, opaque, raster
from render.beads import Beads
from render.camera import VEC3, box_of, lens, look_at
from render.cloth import Sheet
from render.light import DISC, GLASS_SHADE, Light
from render.water import Water, shade_water
from sim.frame import Frame, Static

NO_POINTS, NO_TRIANGLES = np.zeros((1, 3), np.float32), np.zeros((1, 3), np.int32)
CLEAR = (0.0, 0.0, 0.0)  # [1/m]
RIM = 0.25
"""Mesh widths. A solid that stands out of the cloth by less is not seen: over a rim a sheet of flat facets lies that
much too low, though its nodes and the middles of its links keep outside."""
NO_PAIRS = np.zeros((1, 2), np.float32)


@dataclass(frozen=True)
class Look:
    """How a scene is seen: z is up, lengths in metres.

    size    (w, h)  pixels
    eye, target     the camera stands at one and looks at the other
    fov             vertical field of view [rad]
    light           direction in which sunlight travels
    tile            side of a check of the ground
    water           "film", one clear surface, or "particles", a ball each
    """

    size: tuple[int, int] = (1280, 720)
    eye: tuple[float, float, float] = (0.34, -0.38, 0.33)
    target: tuple[float, float, float] = (0.0, 0.0, 0.13)
    fov: float = math.radians(32.0)
    light: tuple[float, float, float] = (-0.5, -0.3, -1.0)
    tile: float = 0.05
    water: str = "film"


_renderers: dict[tuple[int, int], Renderer] = {}


def draw(frame: Frame, look: Look, static: Static) -> np.ndarray:
    """Picture of `frame`, uint8 (h, w, 3); the same frame gives the same bits on any number of threads."""
    size = (int(look.size[0]), int(look.size[1]))
    if size not in _renderers:
        _renderers[size] = Renderer(size)
    return _renderers[size].draw(frame, look, static)


class Renderer:
    """Buffers for pictures of one size, and the order in which they are filled."""

    def __init__(self, size: tuple[int, int]):
        self.size = size
        width, height = size
        self.keys = ti.ndarray(ti.i64, (height, width, 4))
        self.image, self.spare = (ti.ndarray(VEC3, (height, width)) for _ in range(2))
        self.facets = ti.ndarray(opaque.VEC4, (height, width))
        self.water, self.beads = None, None
        self.pixels = np.zeros((height, width, 3), np.uint8)
        self.light = Light()
        self.static, self.sheet, self.placed = None, None, None

    def draw(self, frame: Frame, look: Look, static: Static) -> np.ndarray:
        """See `draw`."""
        self._meet(static)
        self._place(frame, static)
        view, glass = look_at(look.eye, look.target), lens(self.size, look.fov)
        to_sun = (-np.asarray(look.light) / np.linalg.norm(look.light)).astype(np.float32)
        first_solid = self._opaque(frame, look, static, view, glass, to_sun)
        if frame.fluid_x is not None and len(frame.fluid_x):
            if look.water == "particles":
                self.beads = self.beads or Beads(self.size)
                spacing = float(static.spacing)
                self.beads.draw(frame, spacing, view, glass, to_sun, self.keys, self.light, self.image)
            else:
                self._water(frame, static, view, glass, to_sun, first_solid)
        if self.solids:
            opaque.overlay_walls(
                view,
                glass,
                to_sun,
                self.solid_box,
                self.keys,
                self.fronts,
                first_solid,
                self.solid_x,
                self.solid_triangles,
                self.image,
            )
        image.develop(self.image, image.CURVE, self.pixels)
        return self.pixels.copy()

    def _meet(self, static: Static) -> None:
        """Topology, once a run."""
        if static is self.static:
            return
        self.static, self.sheet, self.seen_from = static, None, None
        self.solids = static.solid_triangles is not None and len(static.solid_triangles) > 0
        self.solid_x, self.solid_triangles, self.backs, self.fronts = NO_POINTS, NO_TRIANGLES, self.keys, self.keys
        self.dense = 0
        if static.cloth_triangles is not None:
            self.sheet = Sheet(static.cloth_triangles, static.cloth_uv)
        if self.solids:
            self.solid_triangles = np.ascontiguousarray(static.solid_triangles, np.int32)
            self.dense = 0 if static.solid_opaque is None else int(static.solid_opaque)
            self.backs, self.fronts = (ti.ndarray(ti.i64, self.keys.shape) for _ in range(2))
            self.inner = ti.ndarray(ti.i64, (*self.keys.shape[:2], 1))

    def _place(self, frame: Frame, static: Static) -> None:
        """Where the solids are; their samples are to be taken anew where they have moved."""
        where = static.solid_x if frame.solid_x is None else frame.solid_x
        if self.solids and where is not self.placed:
            self.placed, self.seen_from = where, None
            self.solid_x = np.ascontiguousarray(where, np.float32)

    def _opaque(self, frame: Frame, look: Look, static: Static, view, glass, to_sun) -> int:
        """Everything but water into self.image, and what each sample sees into self.keys."""
        cloth = self.sheet is not None and frame.cloth_x is not None
        meshes, first_solid, rim = [], 0, 0.0
        raster.clear(self.keys, raster.EMPTY)
        sheet_arrays = (NO_POINTS, NO_POINTS, NO_PAIRS, NO_PAIRS, NO_TRIANGLES)
        colour, hem = np.zeros(3, np.float32), np.zeros(4, np.float32)
        if cloth:
            sheet = self.sheet
            sheet.update(frame)
            first_solid, rim = len(sheet.triangles), RIM * sheet.mesh_width
            meshes.append((sheet.points, sheet.triangles, 0, 0.8))
            sheet_arrays = (sheet.points, sheet.normals, sheet.wetness, sheet.uv, sheet.triangles)
            colour, hem = np.asarray(static.cloth_colour, np.float32), sheet.hem
            raster.rasterise(sheet.points, sheet.triangles, 0, view, glass, 1, self.keys, self.keys, 0, 0.0)
        if self.solids:
            dense, clear = self.solid_triangles[: self.dense], self.solid_triangles[self.dense :]
            if len(dense):
                meshes.append((self.solid_x, dense, first_solid, 0.8))
                raster.rasterise(self.solid_x, dense, first_solid, view, glass, 45, self.keys, self.keys, 0, rim)
            if len(clear):
                meshes.append((self.solid_x, clear, first_solid + self.dense, GLASS_SHADE))
            self._walls(view, glass, first_solid)
        self.light.update(meshes, look.light, float(static.ground_z))
        fade = 6.0 * math.dist(look.eye, look.target)
        ground_z = float(static.ground_z) if not math.isnan(float(static.ground_z)) else -1e9
        light = self.light
        opaque.shade_opaque(
            view,
            glass,
            to_sun,
            look.tile,
            fade,
            ground_z,
            self.keys,
            self.backs,
            light.view,
            light.lens,
            light.keys,
            light.nearest,
            DISC,
            light.low,
            light.cell,
            light.seen,
            first_solid,
            first_solid + self.dense,
            *sheet_arrays,
            colour,
            hem,
            self.solid_x,
            self.solid_triangles,
            self.image,
            self.facets,
            cloth,
            self.solids,
        )
        return first_solid

    def _walls(self, view, glass, first_solid: int) -> None:
        """Samples of glass are kept until it or the eye moves."""
        seen_from = (view.tobytes(), glass.tobytes(), first_solid)
        if seen_from == self.seen_from:
            return
        self.seen_from = seen_from
        self.solid_box = box_of(self.solid_x, view, glass, self.size, 0.0)
        raster.clear(self.backs, 0)
        raster.clear(self.fronts, raster.EMPTY)
        raster.clear(self.inner, raster.EMPTY)
        clear = self.solid_triangles[self.dense :]
        if len(clear):
            arrays = (self.solid_x, clear, first_solid + self.dense, view, glass)
            raster.rasterise(*arrays, raster.strips(clear), self.fronts, self.backs, 1, 0.0)
            raster.rasterise(*arrays, raster.strips(clear), self.inner, self.inner, 2, 0.0)

    def _water(self, frame: Frame, static: Static, view, glass, to_sun, first_solid: int) -> None:
        """Water into self.image, in front of what is there."""
        spacing = float(static.spacing)
        absorption = np.float32(CLEAR if static.fluid_absorption is None else static.fluid_absorption)
        if self.water is None:
            self.water = Water(self.size)
        water, light = self.water, self.light
        solids = None
        if self.solids:
            solids = (self.solid_x, self.solid_triangles, first_solid, self.fronts, self.inner, self.backs)
        water.surface(frame, spacing, solids, view, glass, self.facets)
        self.spare.copy_from(self.image)
        shade_water(
            view,
            glass,
            to_sun,
            spacing,
            absorption,
            water.box,
            water.depths,
            water.reach,
            water.body,
            water.normals,
            self.facets,
            self.keys,
            light.view,
            light.lens,
            light.keys,
            light.low,
            light.cell,
            light.seen,
            self.spare,
            self.image,
        )
