"""Cloth: a smooth sheet from its mesh, and a two-sided woven material that darkens and shines when wet."""

import numpy as np
import taichi as ti

from render.raster import POINTS, TRIANGLES

WET_ALBEDO = 0.38  # of the dry albedo at full saturation: light is trapped by total reflection in the water layer
THROUGH = 0.22  # of the light on one face that leaves by the other
FILM_SHINE = 3e-5  # [m] of water hanging below that mirrors fully
REFINE_LIMIT = 40_000  # nodes; finer sheets are smooth as they are
SCALARS = ti.types.ndarray(dtype=ti.f32, ndim=1)
INDICES = ti.types.ndarray(dtype=ti.i32, ndim=1)
PAIRS = ti.types.ndarray(dtype=ti.types.vector(2, ti.i32), ndim=1)
WETNESS = ti.types.ndarray(dtype=ti.types.vector(2, ti.f32), ndim=1)
UV = ti.types.ndarray(dtype=ti.types.vector(2, ti.f32), ndim=1)


@ti.kernel
def smooth(
    x: POINTS,
    triangles: TRIANGLES,
    starts: INDICES,
    around: INDICES,
    links: PAIRS,
    points: POINTS,
    normals: POINTS,
    wetness: WETNESS,
):
    """Area-weighted normals of nodes, then a point on each edge pulled to the tangent planes of its ends.

    Phong tessellation (Boubekeur & Alexa 2008) with weight 3/4, one level.
    """
    count = x.shape[0]
    for i in range(count):
        normal = ti.Vector([0.0, 0.0, 0.0])
        for k in range(starts[i], starts[i + 1]):
            corner = triangles[around[k]]
            normal += (x[corner[1]] - x[corner[0]]).cross(x[corner[2]] - x[corner[0]])
        points[i] = x[i]
        normals[i] = normal / ti.max(normal.norm(), 1e-20)
    for e in range(links.shape[0]):
        i, j = links[e][0], links[e][1]
        middle = 0.5 * (x[i] + x[j])
        pull = (x[i] - middle).dot(normals[i]) * normals[i] + (x[j] - middle).dot(normals[j]) * normals[j]
        normal = normals[i] + normals[j]
        points[count + e] = middle + 0.375 * pull
        normals[count + e] = normal / ti.max(normal.norm(), 1e-20)
        wetness[count + e] = 0.5 * (wetness[i] + wetness[j])


class Sheet:
    """The drawn mesh of a cloth: topology once a run, points, normals and wetness every frame.

    points, normals (k, 3) f32 and wetness (k, 2) f32 (saturation, film [m]), k = nodes + edges when refined;
    triangles (t, 3) i32; uv (k, 2) f32 [m]; hem (4,) the bounds of uv; mesh_width, of the simulated sheet [m].
    """

    def __init__(self, triangles: np.ndarray, uv: np.ndarray):
        self.coarse = np.ascontiguousarray(triangles, np.int32)
        self.count = len(uv)
        corners = self.coarse.ravel()
        self.around = (np.argsort(corners, kind="stable") // 3).astype(np.int32)
        self.starts = np.zeros(self.count + 1, np.int32)
        self.starts[1:] = np.cumsum(np.bincount(corners, minlength=self.count))
        self.links, self.triangles = np.zeros((0, 2), np.int32), self.coarse
        if self.count <= REFINE_LIMIT:
            self._split()
        uv = np.asarray(uv, np.float32)
        self.uv = np.ascontiguousarray(np.concatenate([uv, uv[self.links].mean(axis=1)]), np.float32)
        corners = uv[self.coarse[0]]
        self.mesh_width = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min())
        self.hem = np.concatenate([uv.min(axis=0), uv.max(axis=0)]).astype(np.float32)
        total = self.count + len(self.links)
        self.points, self.normals = np.zeros((2, total, 3), np.float32)
        self.wetness = np.zeros((total, 2), np.float32)

    def _split(self) -> None:
        a, b, c = self.coarse.T
        sides = np.sort(np.stack([np.r_[a, b, c], np.r_[b, c, a]], axis=1), axis=1)
        links, which = np.unique(sides, axis=0, return_inverse=True)
        ab, bc, ca = (self.count + which.ravel()).reshape(3, -1)
        self.links = np.ascontiguousarray(links, np.int32)
        quarters = np.stack([a, ab, ca, ab, b, bc, ca, bc, c, ab, bc, ca], axis=1)
        self.triangles = np.ascontiguousarray(quarters.reshape(-1, 3), np.int32)

    def update(self, frame) -> None:
        """From the nodes of a sim.frame.Frame."""
        x = np.ascontiguousarray(frame.cloth_x, np.float32)
        for column, values in enumerate((frame.cloth_saturation, frame.cloth_film)):
            self.wetness[: self.count, column] = 0.0 if values is None else values
        arrays = (self.starts, self.around, self.links, self.points, self.normals, self.wetness)
        smooth(x, self.coarse, *arrays)


@ti.func
def weave(uv, footprint):
    """Albedo factor of a plain weave of 1.6 mm, faded where a pixel [m] no longer resolves it."""
    u, v = uv[0] / 0.0016, uv[1] / 0.0016
    over = ti.sin(3.14159265 * u) * ti.sin(3.14159265 * v)
    ribs = ti.abs(ti.sin(3.14159265 * u)) if over > 0.0 else ti.abs(ti.sin(3.14159265 * v))
    visible = ti.math.clamp(1.6 - footprint / 0.0005, 0.0, 1.0)
    return 1.0 + visible * 0.16 * (ribs - 0.64)


@ti.func
def seam(uv, hem, footprint):
    """Albedo factor of the doubled border: a 5 mm hem a shade darker, closed by a row of stitches."""
    inside = ti.min(uv[0] - hem[0], uv[1] - hem[1], hem[2] - uv[0], hem[3] - uv[1])
    blur = ti.max(footprint, 0.0002)
    border = 1.0 - ti.math.smoothstep(0.005 - blur, 0.005 + blur, inside)
    line = ti.math.smoothstep(0.0008 + blur, 0.0, ti.abs(inside - 0.0046))
    return 1.0 - 0.05 * border - 0.16 * line


@ti.func
def cloth_albedo(colour, uv, hem, saturation, footprint):
    """Linear RGB: dry cloth by its weave; water multiplies it down, more in the channels it has least of."""
    dry = colour * weave(uv, footprint) * seam(uv, hem, footprint)
    grey = dry.dot(ti.Vector([0.3, 0.5, 0.2]))
    vivid = ti.max(grey + (dry - grey) * 1.18, 0.0)
    wet = ti.math.smoothstep(0.0, 1.0, ti.math.clamp(saturation, 0.0, 1.0))
    return dry + (WET_ALBEDO * vivid - dry) * wet
