"""Water over the opaque picture: refraction, absorption, mirrored sky, sun, smooth silhouettes."""

import math

import numpy as np
import taichi as ti

from render import ripple, splat, walls
from render.camera import BOX, VEC3, VIEW, box_of, ray, row
from render.light import VOLUME, sky_seen, studio, sun_strikes
from render.opaque import FACETS, IMAGE
from render.optics import mirrored, refracted
from render.raster import FAR, KEYS, depth_of
from render.ripple import coverage, hanging, rimmed
from render.splat import BODY, DEPTHS, merged_at

GLINT = 9.0  # of the sun in water, over the sun's irradiance
FOCUS = 0.25  # of (depth x curvature): by how much a curved surface gathers light below it, 1 - 1/INDEX
CREASE = 0.6  # cosine between normals four pixels apart, below which they belong to two surfaces
SMOOTHING = 3  # sweeps over the depths


@ti.func
def in_front(keys: ti.template(), y, x, depth):
    """Fraction of the pixel's samples that see nothing opaque nearer than `depth`."""
    shown = 0.0
    for s in range(4):
        shown += 0.25 if depth_of(keys[y, x, s]) > depth else 0.0
    return shown


@ti.func
def gathered(normals: ti.template(), depths: ti.template(), view, y, x, texel, room):
    """Sunlight on the bed `room` [m] below, over that without water: the surface is a lens of curvature div n, except
    at a crease."""
    bright = 1.0
    y0, y1 = ti.max(y - 2, 0), ti.min(y + 2, depths.shape[0] - 1)
    x0, x1 = ti.max(x - 2, 0), ti.min(x + 2, depths.shape[1] - 1)
    whole = ti.max(depths[y, x0], depths[y, x1], depths[y0, x], depths[y1, x]) < FAR
    if whole and ti.min(normals[y, x0].dot(normals[y, x1]), normals[y0, x].dot(normals[y1, x])) > CREASE:
        curvature = (normals[y, x1] - normals[y, x0]).dot(row(view, 0))
        curvature -= (normals[y1, x] - normals[y0, x]).dot(row(view, 1))
        bright = 1.0 / ti.max(1.0 - FOCUS * ti.min(room, 0.02) * curvature / (4.0 * texel), 0.5)
    return bright


@ti.kernel
def shade_water(
    view: VIEW,
    lens: VEC3,
    to_sun: VEC3,
    spacing: ti.f32,
    absorption: VEC3,
    box: BOX,
    depths: DEPTHS,
    reach: DEPTHS,
    body: BODY,
    normals: IMAGE,
    facets: FACETS,
    keys: KEYS,
    sun_view: VIEW,
    sun_lens: VEC3,
    sun_keys: KEYS,
    low: VEC3,
    cell: ti.f32,
    open_sky: VOLUME,
    image: IMAGE,
    target: IMAGE,
):
    """image, the opaque picture, with water in front -> target, within the box."""
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        colour, depth, alpha = image[y, x], depths[y, x], 0.0
        if depth < FAR:
            alpha = coverage(body, y, x) * in_front(keys, y, x, depth - 0.3 * spacing)
        if alpha > 0.0:
            d = ray(view, lens, x + 0.5, y + 0.5)
            p, away = row(view, 3) + depth * d, d.normalized(1e-12)
            room, water = ti.max(depth_of(keys[y, x, 0]) - depth, 0.0) * d.norm(), body[y, x][1]
            facet = facets[y, x]
            slant = ti.abs(away.dot(ti.Vector([facet[0], facet[1], facet[2]])))
            free = hanging(room, water, slant, spacing)
            merged = merged_at(reach[y, x], depth, spacing, lens[0])
            flat = facet.xyz.dot(normals[y, x]) if room * slant < 2.0 * spacing else 1.0
            normal = rimmed(normals[y, x], body, view, y, x, free, merged * ti.math.smoothstep(0.3, 0.8, flat))
            through = refracted(
                image,
                keys,
                view,
                lens,
                to_sun,
                p,
                away,
                normal,
                colour,
                depth,
                ti.min(room, 1.0),
                water,
                free,
                merged,
                spacing,
                absorption,
            )
            focus = gathered(normals, depths, view, y, x, depth / lens[0], room)
            through *= 1.0 + (1.0 - free) * merged * (focus - 1.0)
            cosine = ti.math.clamp(-away.dot(normal), 0.0, 1.0)
            fresnel = 0.02 + 0.98 * (1.0 - cosine) ** 5
            mirror = away + 2.0 * cosine * normal
            sees = 0.25 + 0.75 * sky_seen(open_sky, low, cell, p + cell * normal)
            mirrored_light = mirrored(image, keys, view, lens, p, mirror, spacing, sees * studio(mirror, to_sun))
            half = (to_sun - away).normalized(1e-12)
            glint = GLINT * (0.3 + 0.7 * merged) * ti.max(half.dot(normal), 0.0) ** (60.0 + 340.0 * merged)
            glint *= ti.min(4.0 * cosine, 1.0)
            if glint > 0.02 and not sun_strikes(sun_keys, sun_view, sun_lens, p + spacing * to_sun):
                glint = 0.0
            colour += alpha * (through + fresnel * (mirrored_light - through) + glint - colour)
        target[y, x] = colour


class Water:
    """Screen buffers of the water of one picture size."""

    def __init__(self, size: tuple[int, int]):
        self.size = size
        width, height = size
        self.keys = ti.ndarray(ti.i64, (height, width, 1))
        self.depths, self.spare, self.reach = (ti.ndarray(ti.f32, (height, width)) for _ in range(3))
        self.body, self.half_body = (ti.ndarray(ti.types.vector(2, ti.f32), (height, width)) for _ in range(2))
        self.cover, self.thick = (ti.ndarray(ti.i32, (height, width)) for _ in range(2))
        self.normals, self.half_normals = (ti.ndarray(VEC3, (height, width)) for _ in range(2))
        self.counts = np.zeros(1, np.int32)
        self.box = np.zeros(4, np.int32)

    def surface(self, frame, spacing: float, solids, view, glass, facets) -> None:
        """From particles to the smooth depth, normal, coverage and thickness of each pixel in self.box.

        solids: (points, triangles, first id, fronts, inner, backs) of what holds it, see render/walls.py, or None.
        """
        x = np.ascontiguousarray(frame.fluid_x, np.float32)
        mass = np.ascontiguousarray(frame.fluid_mass, np.float32)
        first_image, mirrors = len(x), ()
        if solids:
            points, triangles, first, fronts, inner, backs = solids
            rows, places, mirrors = walls.images(x, spacing, points, triangles)
            x = np.concatenate([x, places])
            mass = np.concatenate([mass, mass[rows]])
        company = np.empty(len(x), np.float32)
        buckets = 1 << max(12, math.ceil(math.log2(4 * len(x))))
        if len(self.counts) != buckets:
            self.counts = np.zeros(buckets, np.int32)
        box = self.box = box_of(x, view, glass, self.size, 4.0 * spacing)
        splat.crowd(x, mass, spacing, self.counts, company)
        splat.begin(box, self.keys, self.cover, self.thick)
        splat.splat(x, mass, company, first_image, spacing, view, glass, facets, self.keys, self.cover, self.thick)
        if len(mirrors):
            splat.images(x, mass, company, mirrors, spacing, view, glass, facets, inner, backs, self.keys, self.cover)
        splat.settle(box, self.keys, company, self.depths, self.reach, spacing, float(glass[0]))
        splat.smooth_body(
            box, self.cover, self.thick, self.depths, self.reach, facets, spacing, self.half_body, self.body
        )
        splat.vote(box, self.depths, self.spare, self.reach, 3.0 * spacing)
        self.depths, self.spare = self.spare, self.depths
        for _ in range(SMOOTHING):
            splat.smooth_depth(box, self.depths, self.spare, self.reach, 1, 0, 1.5 * spacing)
            splat.smooth_depth(box, self.spare, self.depths, self.reach, 0, 1, 1.5 * spacing)
        ripple.shape(x, box, view, glass, spacing, self.keys, self.depths, self.reach, self.body, facets, self.normals)
        for step in ((1, 0), (0, 1)):
            source, target = (self.normals, self.half_normals)[:: 1 if step[0] else -1]
            ripple.smooth_normals(source, target, box, self.depths, self.reach, *step, 2.0 * spacing)
        if solids:
            walls.lay_on_glass(
                view,
                glass,
                spacing,
                box,
                fronts,
                inner,
                backs,
                self.keys,
                first_image,
                first,
                points,
                triangles,
                self.reach,
                self.depths,
                self.normals,
            )
