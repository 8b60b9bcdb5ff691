"""Water over the opaque picture: refraction, absorption, mirrored sky, sun, smooth silhouettes."""

import math

import numpy as np
import taichi as ti

from render import raster, splat
from render.camera import VEC3, VIEW, project, ray, row
from render.light import DIRECTIONS, NEAREST, VOLUME, dither, sky, sky_seen, studio, sun_seen
from render.opaque import IMAGE
from render.raster import FAR, KEYS, depth_of
from render.splat import BODY, DEPTHS

INDEX = 1.333  # of refraction
LENS = (0.9, 0.4)  # of a free body's full deflection, alone and merged: its far side is guessed from its near side
DEEP = 0.06  # [m]: tint stops growing about here, or a tank would be a block of ink
BLUR = 0.011  # of the picture's height: what a stream's unseen ripples smear
GLINT = 9.0  # of the sun in water, over the sun's irradiance
ABSORB = (11.0, 2.6, 1.6)  # [1/m]: some thirty times pure water, so that centimetres show the faintest blue-green


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
def behind(image: ti.template(), keys: ti.template(), at, straight, nearest, blur):
    """Opaque colour about the image point `at`, mean of a square of side `blur` [pixels]; `straight` if what stands
    there is nearer than `nearest` [m]."""
    ix = ti.math.clamp(ti.cast(at[0], ti.i32), 0, image.shape[1] - 1)
    iy = ti.math.clamp(ti.cast(at[1], ti.i32), 0, image.shape[0] - 1)
    colour = fetch(image, at[0], at[1])
    if blur > 0.5:
        colour = ti.Vector([0.0, 0.0, 0.0])
        for k in range(16):
            colour += fetch(image, at[0] + blur * (k % 4 - 1.5) / 4.0, at[1] + blur * (k // 4 - 1.5) / 4.0) / 16.0
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
    ahead, behind = FAR, FAR
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


@ti.func
def refracted(
    image: ti.template(), keys: ti.template(), view, lens, p, away, normal, straight, depth, room, water, free, merged,
    spacing,
):
    """Radiance that comes through the water at p: bent once onto what it rests on, twice if it hangs free in the air.

    straight: opaque colour of this pixel; room: way to that surface [m]; water: water on that way [m].
    """
    inside = bend(away, normal, 1.0 / INDEX)
    length = ti.min(water, room)
    level = ti.min(-away.dot(normal) / ti.max(-inside.dot(normal), 0.1), 1.0)
    leave = p + length * (free + (1.0 - free) * level) * inside
    out = bend(inside, 2.0 * normal.dot(away) * away - normal, INDEX)
    out = (inside + free * (away + (LENS[0] + (LENS[1] - LENS[0]) * merged) * (out - away) - inside)).normalized(1e-12)
    at = project(view, lens, leave + free * (room - length) * out)
    colour = behind(image, keys, at, straight, depth - spacing, BLUR * free * merged * image.shape[0])
    if free > 0.0:
        border = ti.min(at[0], image.shape[1] - at[0], at[1], image.shape[0] - at[1])
        known = ti.math.clamp(border / 40.0, 0.0, 1.0) if out.dot(row(view, 2)) > 0.1 else 0.0
        colour += (sky(out) - colour) * (1.0 - known) * free
    return colour * ti.exp(-ti.Vector(ABSORB) * length / (1.0 + length / DEEP))


@ti.func
def in_front(keys: ti.template(), y, x, depth):
    """Fraction of the pixel's samples that see nothing opaque nearer than `depth`."""
    shown = 0.0
    for s in range(4):
        shown += 0.25 if depth_of(keys[y, x, s]) > depth else 0.0
    return shown


@ti.kernel
def shade_water(
    view: VIEW, lens: VEC3, to_sun: VEC3, spacing: ti.f32, depths: DEPTHS, reach: DEPTHS, body: BODY, keys: KEYS,
    sun_view: VIEW, sun_lens: VEC3, sun_keys: KEYS, blocks_near: NEAREST, disc: DIRECTIONS, first_solid: ti.i32,
    low: VEC3, cell: ti.f32, open_sky: VOLUME, image: IMAGE, target: IMAGE,
):
    """image, the opaque picture, with water in front -> target."""
    for y, x in ti.ndrange(target.shape[0], target.shape[1]):
        colour, depth, alpha = image[y, x], depths[y, x], 0.0
        if depth < FAR:
            alpha = coverage(body, y, x) * in_front(keys, y, x, depth - 0.3 * spacing)
        if alpha > 0.0:
            d = ray(view, lens, x + 0.5, y + 0.5)
            p, away = row(view, 3) + depth * d, d.normalized(1e-12)
            room, water = ti.max(depth_of(keys[y, x, 0]) - depth, 0.0) * d.norm(), body[y, x][1]
            free = ti.math.smoothstep(3.0, 7.0, (room - water) / spacing)
            merged = ti.min(0.25 * reach[y, x], 1.0)
            normal = water_normal(depths, view, lens, y, x, 2.0 * spacing)
            bulge = body_normal(body, view, away, y, x, depth / lens[0])
            normal = (normal + 0.85 * free * merged * (bulge - normal)).normalized(1e-12)
            through = refracted(
                image, keys, view, lens, p, away, normal, colour, depth, ti.min(room, 1.0), water, free, merged, spacing
            )
            cosine = ti.math.clamp(-away.dot(normal), 0.0, 1.0)
            fresnel = 0.02 + 0.98 * (1.0 - cosine) ** 5
            mirror = away + 2.0 * cosine * normal
            sees = 0.25 + 0.75 * sky_seen(open_sky, low, cell, p + cell * normal)
            mirrored_light = mirrored(image, keys, view, lens, p, mirror, spacing, sees * studio(mirror, to_sun))
            half = (to_sun - away).normalized(1e-12)
            glint = GLINT * ti.max(half.dot(normal), 0.0) ** 400 * ti.min(4.0 * cosine, 1.0)
            if glint > 0.02:
                lit = p + 0.002 * to_sun
                glint *= sun_seen(sun_keys, blocks_near, disc, sun_view, sun_lens, first_solid, lit, dither(y, x))
            colour += alpha * (through + fresnel * (mirrored_light - through) + glint - colour)
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
