"""What lights a scene: a sky, a sun with soft shadows, and how much of the sky each place sees."""

import math

import numpy as np
import taichi as ti

from render import raster
from render.camera import VEC3, lens, look_at, project
from render.raster import KEYS, POINTS, TRIANGLES, depth_of

SUN = (2.30, 2.20, 2.06)  # irradiance over pi, linear RGB
ZENITH = (0.62, 0.80, 1.08)
HORIZON = (1.70, 1.75, 1.82)
GROUND = (1.50, 1.49, 1.46)  # sunlit checks from afar
BOUNCE = (0.72, 0.71, 0.70)  # from a pale ground
PANES = 8  # windows round the horizon
WINDOW = (4.2, 4.35, 4.5)  # radiance of a window, over the sky's
SUN_SPREAD = 0.035  # tangent of half the sun's angle: a hazy day
MAP = 768  # texels a side
BLOCK = 24  # texels a side of a block whose nearest depth may settle a shadow without sampling it
MARGIN = 1.25  # over the widest penumbra, searched for blockers: sixteen points leave gaps at the rim
CELL_COUNT = 44  # of the ambient volume along its longest side
GLASS_SHADE = 0.45  # of the sun that a glass solid keeps out
DISC = np.stack(
    [np.sqrt((k + 0.5) / 32) * np.array([math.cos(2.399963 * k), math.sin(2.399963 * k)]) for k in range(32)]
).astype(np.float32)
VOLUME = ti.types.ndarray(dtype=ti.f32, ndim=3)
NEAREST = ti.types.ndarray(dtype=ti.f32, ndim=2)
DIRECTIONS = ti.types.ndarray(dtype=ti.types.vector(2, ti.f32), ndim=1)


@ti.func
def sky(direction):
    """Radiance from `direction` (unit): horizon to zenith, pale ground below."""
    up = direction[2]
    colour = ti.Vector(HORIZON) + (ti.Vector(ZENITH) - ti.Vector(HORIZON)) * ti.sqrt(ti.math.clamp(up, 0.0, 1.0))
    if up < 0.0:
        colour = ti.Vector(HORIZON) + (ti.Vector(GROUND) - ti.Vector(HORIZON)) * ti.min(-4.0 * up, 1.0)
    return colour


@ti.func
def studio(direction, to_sun):
    """What water mirrors: the sky, a bright cloud round the sun, and a ring of tall soft windows half-way up, whose
    straight edges tell the eye how the surface lies."""
    cloud = ti.math.smoothstep(0.80, 0.93, direction.dot(to_sun))
    up = direction[2]
    turn = PANES / 6.2831853 * ti.atan2(direction[1], direction[0]) + 0.2
    across = 0.5 - ti.abs(turn - ti.floor(turn) - 0.5)
    window = ti.math.smoothstep(0.08, 0.16, across)
    window *= ti.math.smoothstep(0.25, 0.45, up) * ti.math.smoothstep(0.70, 0.45, up)
    return sky(direction) + cloud * ti.Vector([1.5, 1.5, 1.5]) + window * ti.Vector(WINDOW)


@ti.func
def ambient(normal):
    """Irradiance over pi from sky and ground on a face of that normal."""
    up = 0.5 + 0.5 * normal[2]
    above = 0.55 * ti.Vector(ZENITH) + 0.45 * ti.Vector(HORIZON)
    return ti.Vector(BOUNCE) + (above - ti.Vector(BOUNCE)) * up


@ti.func
def dither(y, x):
    """Interleaved gradient noise in [0, 1), fixed to the pixel (Jimenez 2014)."""
    return ti.math.fract(52.9829189 * ti.math.fract(0.06711056 * x + 0.00583715 * y))


@ti.func
def sun_seen(keys: ti.template(), blocks_near: ti.template(), disc: ti.template(), view, lens, first_glass, p, turn):
    """Fraction of the sun seen from p: percentage-closer soft shadows (Fernando 2005) on a fixed disc of 32 points."""
    at = project(view, lens, p)
    seen = 1.0
    blocks = blocks_near.shape[0]
    bx, by = ti.cast(at[0] / BLOCK, ti.i32), ti.cast(at[1] / BLOCK, ti.i32)
    if 0 < bx < blocks - 1 and 0 < by < blocks - 1:
        nearest = blocks_near[by, bx]
        if at[2] > nearest:
            texel = at[2] / lens[0]
            widest = ti.math.clamp((at[2] - nearest) * SUN_SPREAD / texel, 1.0, (BLOCK - 2.0) / MARGIN)
            total, blockers, solid = 0.0, 0, 0
            for k in range(16):
                px = ti.cast(at[0] + MARGIN * widest * disc[2 * k][0], ti.i32)
                py = ti.cast(at[1] + MARGIN * widest * disc[2 * k][1], ti.i32)
                key = keys[py, px, 0]
                if depth_of(key) < at[2]:
                    total += depth_of(key)
                    blockers += 1
                    solid += 1 if raster.index_of(key) >= first_glass else 0
            if blockers == 16 and (solid == 0 or solid == 16):  # the same all about: no edge of a shadow is near
                seen = 1.0 - (GLASS_SHADE if solid == 16 else 1.0)
            elif blockers > 0:
                reach = (at[2] - total / blockers) * SUN_SPREAD / texel
                reach = ti.math.clamp(reach, 1.0, widest)
                dark = 0.0
                sharp = 1 if reach < 4.0 else 0
                c, s = ti.cos(6.2831853 * turn), ti.sin(6.2831853 * turn)
                for k in range(32):
                    u, v = c * disc[k][0] - s * disc[k][1], s * disc[k][0] + c * disc[k][1]
                    dark += shade(keys, at[0] + reach * u, at[1] + reach * v, at[2], first_glass, sharp)
                seen = 1.0 - dark / 32.0
    return seen


@ti.func
def sun_strikes(keys: ti.template(), view, lens, p):
    """Does the sun reach p past all that casts a shadow? One look at its map: for glints, which are points anyway."""
    at = project(view, lens, p)
    x = ti.math.clamp(ti.cast(at[0], ti.i32), 0, keys.shape[1] - 1)
    y = ti.math.clamp(ti.cast(at[1], ti.i32), 0, keys.shape[0] - 1)
    return depth_of(keys[y, x, 0]) > at[2]


@ti.func
def shade(keys: ti.template(), u, v, depth, first_glass, sharp):
    """Shade at a point of the map: between the four texels about it for a sharp edge, of the texel for a wide one."""
    side = keys.shape[0]
    x, y = ti.cast(ti.floor(u - 0.5 * sharp), ti.i32), ti.cast(ti.floor(v - 0.5 * sharp), ti.i32)
    fx, fy = sharp * (u - 0.5 - x), sharp * (v - 0.5 - y)
    total = 0.0
    for k in range(1 + 3 * sharp):
        i, j = k % 2, k // 2
        key = keys[ti.math.clamp(y + j, 0, side - 1), ti.math.clamp(x + i, 0, side - 1), 0]
        if depth_of(key) < depth:
            weight = (fx if i == 1 else 1.0 - fx) * (fy if j == 1 else 1.0 - fy)
            total += weight * (GLASS_SHADE if raster.index_of(key) >= first_glass else 1.0)
    return total


@ti.kernel
def nearest_of_blocks(keys: KEYS, own: NEAREST, blocks_near: NEAREST):
    """Nearest depth within each block of the sun's map (own) and with the blocks about it (blocks_near)."""
    count = own.shape[0]
    for by, bx in ti.ndrange(count, count):
        nearest = raster.FAR
        for y in range(by * BLOCK, (by + 1) * BLOCK):
            for x in range(bx * BLOCK, (bx + 1) * BLOCK):
                nearest = ti.min(nearest, depth_of(keys[y, x, 0]))
        own[by, bx] = nearest
    for by, bx in ti.ndrange(count, count):
        nearest = raster.FAR
        for y in range(ti.max(0, by - 1), ti.min(count, by + 2)):
            for x in range(ti.max(0, bx - 1), ti.min(count, bx + 2)):
                nearest = ti.min(nearest, own[y, x])
        blocks_near[by, bx] = nearest


@ti.kernel
def fill_cells(x: POINTS, triangles: TRIANGLES, low: VEC3, cell: ti.f32, blocked: VOLUME, amount: ti.f32):
    """Mark the cells that triangles cross, by points half a cell apart."""
    for t in range(triangles.shape[0]):
        corner = triangles[t]
        a, ab, ac = x[corner[0]], x[corner[1]] - x[corner[0]], x[corner[2]] - x[corner[0]]
        n = ti.cast(ti.ceil(2.0 * ti.max(ab.norm(), ac.norm(), (ac - ab).norm()) / cell), ti.i32) + 1
        for i in range(n + 1):
            for j in range(n + 1 - i):
                c = ti.floor((a + ab * (i / n) + ac * (j / n) - low) / cell, ti.i32)
                if 0 <= c[0] < blocked.shape[0] and 0 <= c[1] < blocked.shape[1] and 0 <= c[2] < blocked.shape[2]:
                    blocked[c[0], c[1], c[2]] = amount


@ti.kernel
def see_sky(blocked: VOLUME, seen: VOLUME, disc: DIRECTIONS):
    """Fraction of the sky seen from each cell: twelve cosine-spread rays, turned from cell to cell in fours."""
    nx, ny, nz = blocked.shape[0], blocked.shape[1], blocked.shape[2]
    for i, j, k in ti.ndrange(nx, ny, nz):
        turn = ((i & 1) + 2 * (j & 1) + (k & 1)) % 4
        total = 0.0
        for r in range(12):
            angle = 0.13 * turn
            d = 1.1 * disc[2 * r]
            d = ti.Vector([d[0] * ti.cos(angle) - d[1] * ti.sin(angle), d[0] * ti.sin(angle) + d[1] * ti.cos(angle)])
            step = ti.Vector([d[0], d[1], ti.sqrt(ti.max(1.0 - d.dot(d), 0.02))])
            at = ti.Vector([i + 0.5, j + 0.5, k + 0.5]) + 1.4 * step
            clear = 1.0
            while clear > 0.05 and 0 < at[0] < nx and 0 < at[1] < ny and 0 < at[2] < nz:
                clear *= 1.0 - blocked[ti.cast(at[0], ti.i32), ti.cast(at[1], ti.i32), ti.cast(at[2], ti.i32)]
                at += step
            total += clear
        seen[i, j, k] = total / 12.0


@ti.kernel
def blur_cells(source: VOLUME, target: VOLUME):
    """Tent-weighted mean over 3 x 3 x 3 cells, which evens out the turned rays; open sky beyond the sides."""
    nx, ny, nz = source.shape[0], source.shape[1], source.shape[2]
    for i, j, k in ti.ndrange(nx, ny, nz):
        total, weight = 0.0, 0.0
        for a in range(-1, 2):
            for b in range(-1, 2):
                for c in range(-1, 2):
                    w = (2.0 - ti.abs(a)) * (2.0 - ti.abs(b)) * (2.0 - ti.abs(c))
                    p, q, r = i + a, j + b, k + c
                    value = 1.0
                    if 0 <= p < nx and 0 <= q < ny:
                        value = source[p, q, ti.math.clamp(r, 0, nz - 1)]
                    total += w * value
                    weight += w
        target[i, j, k] = total / weight


@ti.func
def sky_seen(seen: ti.template(), low, cell, p):
    """Fraction of the sky seen at p, linear between cells; 1 outside the volume."""
    at = (p - low) / cell - 0.5
    base = ti.floor(at, ti.i32)
    f = at - base
    nx, ny, nz = seen.shape[0], seen.shape[1], seen.shape[2]
    value = 1.0
    if -1 <= base[0] < nx and -1 <= base[1] < ny and base[2] < nz:
        value = 0.0
        for i in range(2):
            for j in range(2):
                for k in range(2):
                    a, b, c = base[0] + i, base[1] + j, ti.max(base[2] + k, 0)
                    weight = (f[0] if i == 1 else 1.0 - f[0]) * (f[1] if j == 1 else 1.0 - f[1])
                    weight *= f[2] if k == 1 else 1.0 - f[2]
                    there = 1.0
                    if 0 <= a < nx and 0 <= b < ny and c < nz:
                        there = seen[a, b, c]
                    value += weight * there
    return value


class Light:
    """Sun map and ambient volume of one frame; `update` fills them from meshes [(x, triangles, first_id, amount)]."""

    def __init__(self):
        self.keys = ti.ndarray(ti.i64, (MAP, MAP, 1))
        self.own, self.nearest = (ti.ndarray(ti.f32, (MAP // BLOCK, MAP // BLOCK)) for _ in range(2))
        self.view, self.lens = look_at((0, 0, 1), (0, 0, 0)), lens((MAP, MAP), 0.1)
        self.low, self.cell = np.zeros(3, np.float32), 1.0
        self.seen = np.ones((1, 1, 1), np.float32)

    def update(self, meshes, direction, ground_z: float) -> None:
        """direction: the way light travels. The sun stands twenty scene radii off: rays part by under 3 degrees."""
        raster.clear(self.keys, raster.EMPTY)
        if meshes:
            low = np.min([m[0].min(axis=0) for m in meshes], axis=0)
            high = np.max([m[0].max(axis=0) for m in meshes], axis=0)
            self._aim(low, high, np.asarray(direction, float))
            for x, triangles, first_id, _ in meshes:
                bands = raster.strips(triangles)
                raster.rasterise(x, triangles, first_id, self.view, self.lens, bands, self.keys, self.keys, 0, 0.0)
            self._ambient(meshes, low, high, ground_z)
        nearest_of_blocks(self.keys, self.own, self.nearest)

    def _aim(self, low, high, direction) -> None:
        grain = 0.02 * float(np.max(high - low)) + 1e-6
        grain = 2.0 ** math.ceil(math.log2(grain))  # aim in coarse steps, so that shadows do not crawl as cloth moves
        centre = np.round(0.5 * (low + high) / grain) * grain
        radius = grain * math.ceil((0.5 * float(np.linalg.norm(high - low)) + grain) / grain)
        distance = 20.0 * radius
        self.view = look_at(centre - distance * direction / np.linalg.norm(direction), centre)
        self.lens = lens((MAP, MAP), 2.0 * math.atan(radius * MAP / (MAP - 4.0 * BLOCK) / distance))

    def _ambient(self, meshes, low, high, ground_z: float) -> None:
        if not math.isnan(ground_z):
            low = np.minimum(low, [*low[:2], ground_z])
        cell = 2.0 ** (math.ceil(2.0 * math.log2(float(np.max(high - low)) * 1.6 / CELL_COUNT)) / 2.0)
        margin = 0.25 * float(np.max(high - low))
        low = np.floor((low - [margin, margin, 0.0]) / cell) * cell
        high = high + [margin, margin, 2.0 * cell]
        shape = tuple(int(n) for n in np.ceil((high - low) / cell))
        if self.seen.shape != shape:
            self.seen = np.ones(shape, np.float32)
        blocked, raw = np.zeros(shape, np.float32), np.empty(shape, np.float32)
        self.low, self.cell = low.astype(np.float32), float(cell)
        for x, triangles, _, amount in meshes:
            fill_cells(x, triangles, self.low, self.cell, blocked, amount)
        see_sky(blocked, raw, DISC)
        blur_cells(raw, self.seen)
