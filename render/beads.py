"""Water as its particles: a ball of each one's volume, coloured by its speed."""

import numpy as np
import taichi as ti

from render import raster
from render.camera import BOX, VEC3, VIEW, box_of, project, ray, row
from render.cloth import SCALARS
from render.light import SUN, VOLUME, ambient, sky_seen, sun_strikes
from render.opaque import IMAGE
from render.raster import EMPTY, KEYS, POINTS, depth_of, index_of, pack, sample_offset

REST_DENSITY = 1000.0  # [kg/m^3]: turns mass into the volume that is drawn
SLOW, FAST = (0.02, 0.13, 0.40), (0.72, 0.86, 0.95)  # albedo, linear RGB
LIVELY = 0.4  # [m/s] half-way between the two


@ti.func
def radius_of(mass):
    """Of a ball of that mass of water [m]."""
    return ti.pow(0.2387324 * mass / REST_DENSITY, 1.0 / 3.0)


@ti.kernel
def splat(x: POINTS, mass: SCALARS, view: VIEW, lens: VEC3, opaque: KEYS, beads: KEYS):
    """The nearest ball of each sample, where nothing opaque is nearer."""
    height, width = beads.shape[0], beads.shape[1]
    for i in range(x.shape[0]):
        at = project(view, lens, x[i])
        if at[2] > 0.01:
            texel = at[2] / lens[0]
            radius = ti.max(radius_of(mass[i]), 0.5 * texel)
            reach = radius / texel
            x0, x1 = ti.max(ti.cast(at[0] - reach, ti.i32), 0), ti.min(ti.cast(at[0] + reach, ti.i32) + 1, width)
            y0, y1 = ti.max(ti.cast(at[1] - reach, ti.i32), 0), ti.min(ti.cast(at[1] + reach, ti.i32) + 1, height)
            for py in range(y0, y1):
                for px in range(x0, x1):
                    for s in range(4):
                        offset = sample_offset(s, 4)
                        du, dv = (px + offset[0] - at[0]) * texel, (py + offset[1] - at[1]) * texel
                        room = radius * radius - du * du - dv * dv
                        depth = at[2] - ti.sqrt(ti.max(room, 0.0))
                        if room > 0.0 and depth < depth_of(opaque[py, px, s]):
                            ti.atomic_min(beads[py, px, s], pack(depth, i))


@ti.kernel
def shade(
    x: POINTS,
    v: POINTS,
    view: VIEW,
    lens: VEC3,
    to_sun: VEC3,
    spacing: ti.f32,
    box: BOX,
    beads: KEYS,
    sun_view: VIEW,
    sun_lens: VEC3,
    sun_keys: KEYS,
    low: VEC3,
    cell: ti.f32,
    open_sky: VOLUME,
    image: IMAGE,
):
    """Balls over the picture: sun, sky, and a highlight; each sample a quarter of its pixel."""
    for py, px in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        colour = image[py, px]
        under = colour
        for s in range(4):
            key = beads[py, px, s]
            if depth_of(key) < 1e30:
                i, offset = index_of(key), sample_offset(s, 4)
                away = ray(view, lens, px + offset[0], py + offset[1])
                p = row(view, 3) + depth_of(key) * away
                normal = (p - x[i]).normalized(1e-12)
                lit = ti.max(normal.dot(to_sun), 0.0)
                if lit > 0.0 and not sun_strikes(sun_keys, sun_view, sun_lens, p + spacing * to_sun):
                    lit = 0.0
                speed = v[i].norm() / (v[i].norm() + LIVELY)
                albedo = ti.Vector(SLOW) + speed * (ti.Vector(FAST) - ti.Vector(SLOW))
                sees = 0.3 + 0.7 * sky_seen(open_sky, low, cell, p + cell * normal)
                half = (to_sun - away.normalized(1e-12)).normalized(1e-12)
                shine = 0.6 * (lit > 0.0) * ti.max(half.dot(normal), 0.0) ** 60.0
                colour += 0.25 * (albedo * (lit * ti.Vector(SUN) + sees * ambient(normal)) + shine - under)
        image[py, px] = colour


class Beads:
    """The buffer of balls of one picture size."""

    def __init__(self, size: tuple[int, int]):
        self.size = size
        self.keys = ti.ndarray(ti.i64, (size[1], size[0], 4))

    def draw(self, frame, spacing: float, view, glass, to_sun, opaque, light, image) -> None:
        """Over `image`, the opaque picture, whose samples are in `opaque`."""
        x, v, mass = (np.ascontiguousarray(getattr(frame, f"fluid_{n}"), np.float32) for n in ("x", "v", "mass"))
        box = box_of(x, view, glass, self.size, spacing)
        raster.clear(self.keys, EMPTY)
        splat(x, mass, view, glass, opaque, self.keys)
        lamp = (light.view, light.lens, light.keys, light.low, light.cell, light.seen)
        shade(x, v, view, glass, to_sun, spacing, box, self.keys, *lamp, image)
