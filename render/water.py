"""Water over the opaque picture: refraction, absorption, mirrored sky, sun, smooth silhouettes."""

import math

import numpy as np
import taichi as ti

from render import raster, splat
from render.camera import VEC3, VIEW, project, ray, row
from render.light import DIRECTIONS, RANGES, VOLUME, sky, sky_seen, studio, sun_seen
from render.opaque import IMAGE
from render.raster import KEYS, depth_of
from render.splat import BODY, DEPTHS

INDEX = 1.333  # of refraction
LENS = 0.4  # of the true deflection by a free body, whose far side is guessed from its near side
ABSORB = (9.0, 2.2, 1.4)  # [1/m]: twenty times pure water, so that centimetres show the faintest blue-green


@ti.func
def fetch(image: ti.template(), u, v):
    """Bilinear colour at (u, v) pixels, clamped to the border."""
    height, width = image.shape[0], image.shape[1]
    u, v = ti.math.clamp(u - 0.5, 0.0, width - 1.001), ti.math.clamp(v - 0.5, 0.0, height - 1.001)
    x, y = ti.cast(u, ti.i32), ti.cast(v, ti.i32)
    fx, fy = u - x, v - y
    top = image[y, x] * (1.0 - fx) + image[y, x + 1] * fx
    return top * (1.0 - fy) + (image[y + 1, x] * (1.0 - fx) + image[y + 1, x + 1] * fx) * fy


@ti.func
def behind(image: ti.template(), keys: ti.template(), at, straight, nearest):
    """Opaque colour at the image point `at`, unless something nearer than `nearest` [m] stands there."""
    ix = ti.math.clamp(ti.cast(at[0], ti.i32), 0, image.shape[1] - 1)
    iy = ti.math.clamp(ti.cast(at[1], ti.i32), 0, image.shape[0] - 1)
    colour = fetch(image, at[0], at[1])
    if depth_of(keys[iy, ix, 0]) < nearest:
        colour = straight
    return colour


@ti.func
def mirrored(image: ti.template(), keys: ti.template(), view, lens, p, direction, spacing, sky_colour):
    """What a mirror ray from p meets on the screen, by steps that grow; the sky if it meets nothing there."""
    colour, along, step = sky_colour, 1.5 * spacing, 1.5 * spacing
    for _ in range(18):
        at = project(view, lens, p + along * direction)
        x, y = ti.cast(ti.floor(at[0]), ti.i32), ti.cast(ti.floor(at[1]), ti.i32)
        if at[2] < 0.01 or not (0 <= x < image.shape[1] and 0 <= y < image.shape[0]):
            break
        past = at[2] - depth_of(keys[y, x, 0])
        if 0.0 < past < 1.5 * step + spacing:
            colour = fetch(image, at[0], at[1])
            break
        step *= 1.18
        along += step
    return colour


@ti.func
def slope(depths: ti.template(), y, x, step_y, step_x, band):
    """Depth change per pixel along one axis, from the side that stays on the same water."""
    height, width = depths.shape[0], depths.shape[1]
    middle = depths[y, x]
    ahead, behind = raster.FAR, raster.FAR
    if y + step_y < height and x + step_x < width:
        ahead = depths[y + step_y, x + step_x] - middle
    if y >= step_y and x >= step_x:
        behind = middle - depths[y - step_y, x - step_x]
    change = 0.0
    if ti.abs(ahead) < band and ti.abs(behind) < band:
        change = 0.5 * (ahead + behind)
    elif ti.abs(ahead) < band or ti.abs(behind) < band:
        change = ahead if ti.abs(ahead) < ti.abs(behind) else behind
    return change


@ti.func
def water_normal(depths: ti.template(), view, lens, y, x, band):
    """Unit normal of the smoothed surface, towards the eye."""
    depth = depths[y, x]
    d = ray(view, lens, x + 0.5, y + 0.5)
    du = slope(depths, y, x, 0, 1, band) * d + depth / lens[0] * row(view, 0)
    dv = slope(depths, y, x, 1, 0, band) * d - depth / lens[0] * row(view, 1)
    normal = du.cross(dv).normalized(1e-20)
    return -normal if normal.dot(d) > 0.0 else normal


@ti.func
def body_normal(body: ti.template(), view, away, y, x, texel):
    """Normal of a free body symmetric about the image plane: its near side bulges by half its thickness."""
    height, width = body.shape[0], body.shape[1]
    du = body[y, ti.min(x + 1, width - 1)][1] - body[y, ti.max(x - 1, 0)][1]
    dv = body[ti.min(y + 1, height - 1), x][1] - body[ti.max(y - 1, 0), x][1]
    scale = 0.25 / texel
    return (-away - scale * du * row(view, 0) + scale * dv * row(view, 1)).normalized(1e-12)


@ti.func
def bend(direction, normal, ratio):
    """Refracted unit direction (Snell); the mirrored one where all is reflected."""
    cosine = -direction.dot(normal)
    k = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    bent = direction + 2.0 * cosine * normal
    if k > 0.0:
        bent = ratio * direction + (ratio * cosine - ti.sqrt(k)) * normal
    return bent


@ti.func
def coverage(body: ti.template(), y, x):
    """How much of the pixel lies inside the outline cover = 1/2, from its distance over its gradient."""
    height, width = body.shape[0], body.shape[1]
    value = body[y, x][0]
    gx = body[y, ti.min(x + 1, width - 1)][0] - body[y, ti.max(x - 1, 0)][0]
    gy = body[ti.min(y + 1, height - 1), x][0] - body[ti.max(y - 1, 0), x][0]
    gradient = 0.5 * ti.sqrt(gx * gx + gy * gy)
    return ti.math.clamp(0.5 + (value - 0.5) / ti.max(gradient, 0.02), 0.0, 1.0)


@ti.kernel
def shade_water(
    view: VIEW, lens: VEC3, to_sun: VEC3, spacing: ti.f32, depths: DEPTHS, reach: DEPTHS, body: BODY,
    keys: KEYS, sun_view: VIEW, sun_lens: VEC3, sun_keys: KEYS, ranges: RANGES, disc: DIRECTIONS, first_solid: ti.i32,
    low: VEC3, cell: ti.f32, open_sky: VOLUME, image: IMAGE, target: IMAGE,
):
    """Composite: image is the opaque picture, target the picture with water."""
    for y, x in ti.ndrange(target.shape[0], target.shape[1]):
        colour, depth = image[y, x], depths[y, x]
        if depth < 1e30:
            shown = 0.0
            for s in range(4):
                shown += 0.25 if depth_of(keys[y, x, s]) > depth - 0.3 * spacing else 0.0
            alpha = coverage(body, y, x) * shown
            if alpha > 0.0:
                d = ray(view, lens, x + 0.5, y + 0.5)
                stretch = d.norm()
                away = d / stretch
                p = row(view, 3) + depth * d
                depth_behind = depth_of(keys[y, x, 0])
                room = ti.max(depth_behind - depth, 0.0) * stretch
                water = body[y, x][1]
                free = ti.math.smoothstep(3.0, 7.0, (room - water) / spacing)
                length = ti.min(water, room)
                normal = water_normal(depths, view, lens, y, x, 2.0 * spacing)
                if free > 0.0:
                    swell = body_normal(body, view, away, y, x, depth / lens[0])
                    normal += free * ti.min(0.25 * reach[y, x], 0.85) * (swell - normal)
                    normal = normal.normalized(1e-12)
                inside = bend(away, normal, 1.0 / INDEX)
                cosine = -away.dot(normal)
                path = length * ti.min(cosine / ti.max(-inside.dot(normal), 0.1), 1.0) if free < 1.0 else length
                leave = p + path * inside
                back = normal - 2.0 * normal.dot(away) * away
                out = bend(inside, -back, INDEX)
                travel = ti.math.clamp(room - length, 0.0, 1.0)
                out = (inside * (1.0 - free) + (LENS * out + (1.0 - LENS) * away) * free).normalized(1e-12)
                goal = leave + travel * free * out
                seen_at = project(view, lens, goal)
                through = behind(image, keys, seen_at, colour, depth - spacing)
                if free > 0.0:
                    border = ti.min(seen_at[0], image.shape[1] - seen_at[0], seen_at[1], image.shape[0] - seen_at[1])
                    known = ti.math.clamp(border / 40.0, 0.0, 1.0) if out.dot(row(view, 2)) > 0.1 else 0.0
                    through += (sky(out) - through) * (1.0 - known) * free
                through *= ti.exp(-ti.Vector(ABSORB) * length)
                fresnel = 0.02 + 0.98 * ti.pow(1.0 - ti.math.clamp(cosine, 0.0, 1.0), 5.0)
                mirror = away + 2.0 * cosine * normal
                sees = sky_seen(open_sky, low, cell, p + cell * normal)
                half = (to_sun - away).normalized(1e-12)
                glint = ti.max(half.dot(normal), 0.0) ** 400 * 9.0 * ti.min(4.0 * cosine, 1.0)
                if glint > 0.02:
                    glint *= sun_seen(sun_keys, ranges, disc, sun_view, sun_lens, first_solid, p + 0.002 * to_sun, 0.0)
                reflected = studio(mirror, to_sun) * (0.25 + 0.75 * sees)
                if fresnel > 0.03:
                    reflected = mirrored(image, keys, view, lens, p, mirror, spacing, reflected)
                shine = fresnel * reflected
                colour += alpha * (through * (1.0 - fresnel) + shine + glint - colour)
        target[y, x] = colour


class Water:
    """Screen buffers of the water of one picture size."""

    def __init__(self, size: tuple[int, int]):
        width, height = size
        self.keys = ti.ndarray(ti.i64, (height, width, 1))
        self.depths, self.spare, self.reach = (ti.ndarray(ti.f32, (height, width)) for _ in range(3))
        self.body, self.half_body = (ti.ndarray(ti.types.vector(2, ti.f32), (height, width)) for _ in range(2))
        self.cover, self.thick = (ti.ndarray(ti.i32, (height, width)) for _ in range(2))
        self.image = ti.ndarray(VEC3, (height, width))
        self.counts = np.zeros(1, np.int32)

    def surface(self, frame, spacing: float, view, glass, facets) -> None:
        """From particles to the smooth depth, coverage and thickness of each pixel."""
        x = np.ascontiguousarray(frame.fluid_x, np.float32)
        mass = np.ascontiguousarray(frame.fluid_mass, np.float32)
        company = np.empty(len(x), np.float32)
        buckets = 1 << max(12, math.ceil(math.log2(4 * len(x))))
        if len(self.counts) != buckets:
            self.counts = np.zeros(buckets, np.int32)
        splat.crowd(x, mass, spacing, self.counts, company)
        raster.clear(self.keys, raster.EMPTY)
        self.cover.fill(0)
        self.thick.fill(0)
        splat.splat(x, mass, company, spacing, view, glass, facets, self.keys, self.cover, self.thick)
        splat.settle(self.keys, company, self.depths, self.reach, spacing, float(glass[0]))
        splat.smooth_body(self.cover, self.thick, self.reach, self.half_body, self.body)
        for _ in range(3):
            splat.smooth_depth(self.depths, self.spare, self.reach, 1, 0, 1.5 * spacing)
            splat.smooth_depth(self.spare, self.depths, self.reach, 0, 1, 1.5 * spacing)
