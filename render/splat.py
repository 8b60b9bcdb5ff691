"""Particles to screen: nearest water depth, coverage and thickness of each pixel, then one smooth surface.

Sums are integers, so the order in which threads add does not matter. All work stays within a box of pixels
(x0, y0, x1, y1) that holds all water with room to spare.
"""

import taichi as ti

from render.camera import BOX, VEC3, VIEW, project, ray, row
from render.cloth import SCALARS
from render.opaque import FACETS
from render.raster import EMPTY, FAR, KEYS, POINTS, depth_of, pack

REST_DENSITY = 1000.0  # [kg/m^3]: turns mass into the volume that is drawn
FIXED = 4096.0  # units of coverage
DEPTH_UNIT = 1e-7  # [m] of water
BULK = 0.95  # radius of a particle among others, in spacings: neighbours merge
WIDTH = 1.1  # of the blur of depths among company, in spacings
WIDEST = 24.0  # [pixels] of that blur
OUTLINE = 0.7  # width of the blur of outlines, in that of depths
VOTE = 4  # pixels about one that decide which of two layers of water it shows
FRINGE = 24.0  # spacings before a surface within which a ball shows past the edge of what hides its centre
COUNTS = ti.types.ndarray(dtype=ti.i32, ndim=1)
PLANES = ti.types.ndarray(dtype=ti.types.vector(4, ti.f32), ndim=1)
LAYER = ti.types.ndarray(dtype=ti.i32, ndim=2)
BODY = ti.types.ndarray(dtype=ti.types.vector(2, ti.f32), ndim=2)
DEPTHS = ti.types.ndarray(dtype=ti.f32, ndim=2)


@ti.func
def bucket(cell, mask):
    """Hash of an integer cell (Teschner 2003)."""
    return ((cell[0] * 73856093) ^ (cell[1] * 19349663) ^ (cell[2] * 83492791)) & mask


@ti.func
def share(f, a: ti.template(), b: ti.template(), c: ti.template()):
    """Part that corner (a, b, c) of a cell takes of a particle at f in it."""
    return (f[0] if a else 1.0 - f[0]) * (f[1] if b else 1.0 - f[1]) * (f[2] if c else 1.0 - f[2])


@ti.kernel
def crowd(x: POINTS, mass: SCALARS, spacing: ti.f32, counts: COUNTS, company: SCALARS):
    """How far each particle is among others, 0 alone to 1: mass is spread over cells of two spacings and read back."""
    mask = counts.shape[0] - 1
    unit = REST_DENSITY * spacing**3
    for i in range(counts.shape[0]):
        counts[i] = 0
    for i in range(x.shape[0]):
        at = x[i] / (2.0 * spacing)
        base = ti.floor(at, ti.i32)
        for a, b, c in ti.static(ti.ndrange(2, 2, 2)):
            part = share(at - base, a, b, c) * mass[i] / unit
            ti.atomic_add(counts[bucket(base + ti.Vector([a, b, c]), mask)], ti.cast(FIXED * part + 0.5, ti.i32))
    for i in range(x.shape[0]):
        at = x[i] / (2.0 * spacing)
        base = ti.floor(at, ti.i32)
        around = 0.0
        for a, b, c in ti.static(ti.ndrange(2, 2, 2)):
            part = share(at - base, a, b, c)
            around += part * (counts[bucket(base + ti.Vector([a, b, c]), mask)] / FIXED - part * mass[i] / unit)
        company[i] = ti.math.smoothstep(0.1, 0.8, around)


@ti.func
def ball(mass, company, spacing, texel):
    """(radius, outer radius where coverage ends, radius of the thickness kernel) of a particle [m]."""
    lone = ti.pow(0.2387324 * mass / REST_DENSITY, 1.0 / 3.0)
    radius = ti.max(lone + company * ti.max(BULK * spacing - lone, 0.0), 0.5 * texel)
    outer = radius + ti.max(0.5 * texel, 0.22 * spacing * company)
    return radius, outer, ti.max(1.5 * lone + 0.9 * spacing * company, 1.2 * texel)


@ti.func
def square(at, reach, width, height):
    """Pixels (x0, y0, x1, y1) within `reach` pixels of a point of the picture."""
    x, y = ti.cast(at[0] - reach, ti.i32), ti.cast(at[1] - reach, ti.i32)
    x1, y1 = ti.cast(at[0] + reach, ti.i32) + 1, ti.cast(at[1] + reach, ti.i32) + 1
    return ti.Vector([ti.max(x, 0), ti.max(y, 0), ti.min(x1, width), ti.min(y1, height)])


@ti.kernel
def begin(box: BOX, water: KEYS, cover: LAYER, thick: LAYER):
    """No water anywhere in the box."""
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        water[y, x, 0] = ti.i64(EMPTY)
        cover[y, x] = 0
        thick[y, x] = 0


@ti.kernel
def splat(
    x: POINTS,
    mass: SCALARS,
    company: SCALARS,
    first_image: ti.i32,
    spacing: ti.f32,
    view: VIEW,
    lens: VEC3,
    facets: FACETS,
    water: KEYS,
    cover: LAYER,
    thick: LAYER,
):
    """Add every particle, the rows before first_image, as a ball seen in front of the opaque surfaces.

    cover: sum of (R - d)/(2(R - r)), half at a lone ball's edge; thick: mean depth of water along the ray [DEPTH_UNIT].
    """
    height, width = water.shape[0], water.shape[1]
    for i in range(first_image):
        at = project(view, lens, x[i])
        if at[2] > 0.01:
            texel = at[2] / lens[0]
            radius, outer, spread = ball(mass[i], company[i], spacing, texel)
            peak = 3.0 * mass[i] / REST_DENSITY / (3.14159265 * spread * spread) / DEPTH_UNIT
            room = FAR
            if company[i] > 0.5 and hidden(x[i], at, spacing, view, lens, facets):
                room = FRINGE * spacing
            reach = ti.max(outer, spread) / texel
            near_by = square(at, reach, width, height)
            for py in range(near_by[1], near_by[3]):
                for px in range(near_by[0], near_by[2]):
                    du, dv = (px + 0.5 - at[0]) * texel, (py + 0.5 - at[1]) * texel
                    d_sq = du * du + dv * dv
                    near = d_sq < ti.max(outer, spread) ** 2
                    if near and seen(x[i], at[2], spacing, room, view, lens, px, py, facets):
                        if d_sq < outer * outer:
                            front = at[2] - ti.sqrt(outer * outer - d_sq) + (outer - radius)
                            ti.atomic_min(water[py, px, 0], pack(front, i))
                            if cover[py, px] < ti.cast(FIXED, ti.i32):  # what is over 1 is cut: no matter who sees it
                                edge = ti.min(0.5 * (outer - ti.sqrt(d_sq)) / (outer - radius), 1.0)
                                ti.atomic_add(cover[py, px], ti.cast(FIXED * edge, ti.i32))
                        q = ti.max(1.0 - d_sq / (spread * spread), 0.0)
                        ti.atomic_add(thick[py, px], ti.cast(peak * q * q, ti.i32))


@ti.kernel
def images(
    x: POINTS,
    mass: SCALARS,
    company: SCALARS,
    mirrors: PLANES,
    spacing: ti.f32,
    view: VIEW,
    lens: VEC3,
    facets: FACETS,
    inner: KEYS,
    backs: KEYS,
    water: KEYS,
    cover: LAYER,
):
    """Add the mirror images of the particles that lie on walls: what of such a ball stands out of its wall, or is seen
    through it, which `lay_on_glass` will push back behind it.

    mirrors: (normal, gap) of the last rows of x, each `gap` [m] behind its wall; inner, backs: see there.
    """
    height, width = water.shape[0], water.shape[1]
    first = x.shape[0] - mirrors.shape[0]
    for k in range(mirrors.shape[0]):
        i, plane = first + k, mirrors[k]
        at = project(view, lens, x[i])
        if at[2] > 0.01:
            texel = at[2] / lens[0]
            radius, outer, _ = ball(mass[i], company[i], spacing, texel)
            reach = outer / texel
            near_by = square(at, reach, width, height)
            for py in range(near_by[1], near_by[3]):
                for px in range(near_by[0], near_by[2]):
                    du, dv = (px + 0.5 - at[0]) * texel, (py + 0.5 - at[1]) * texel
                    d_sq = du * du + dv * dv
                    if d_sq < outer * outer:
                        front = at[2] - ti.sqrt(outer * outer - d_sq) + (outer - radius)
                        p = row(view, 3) + front * ray(view, lens, px + 0.5, py + 0.5)
                        stands_out = (p - x[i]).dot(plane.xyz) >= plane[3]
                        if not stands_out:
                            leaves = depth_of(inner[py, px, 0])
                            stands_out = front < leaves < depth_of(backs[py, px, 0])
                        if stands_out and front < facets[py, px][3]:
                            ti.atomic_min(water[py, px, 0], pack(front, i))
                            edge = ti.min(0.5 * (outer - ti.sqrt(d_sq)) / (outer - radius), 1.0)
                            ti.atomic_add(cover[py, px], ti.cast(FIXED * edge, ti.i32))


@ti.func
def hidden(x, at, spacing, view, lens, facets: ti.template()):
    """Is the very centre behind a surface? Beyond the edge of what hides it, such a ball would show as a fringe."""
    px, py = ti.cast(ti.floor(at[0]), ti.i32), ti.cast(ti.floor(at[1]), ti.i32)
    answer = False
    if 0 <= px < facets.shape[1] and 0 <= py < facets.shape[0]:
        answer = not seen(x, at[2], spacing, FAR, view, lens, px, py, facets)
    return answer


@ti.func
def seen(x, depth, spacing, room, view, lens, px, py, facets: ti.template()):
    """Is the particle on the viewer's side of what the pixel shows? Near a surface its tangent plane decides."""
    facet = facets[py, px]
    wall = facet[3]
    side = wall - depth
    if ti.abs(side) < 4.0 * spacing:
        p = row(view, 3) + wall * ray(view, lens, px + 0.5, py + 0.5)
        side = (x - p).dot(ti.Vector([facet[0], facet[1], facet[2]])) + 0.15 * spacing
    return 0.0 < side < room


@ti.func
def bell(k, sigma):
    """A Gaussian's shape, (1 - (k/(2.5 sigma))^2)^2, but compact and without exp."""
    q = k / (2.5 * sigma)
    w = ti.max(1.0 - q * q, 0.0)
    return w * w


@ti.func
def merged_at(reach, depth, spacing, focal):
    """0 for a lone particle, 1 for one of a body: the width of its smoothing over the widest at that depth."""
    return ti.min(1.7 * reach / ti.min(WIDTH * spacing * focal / depth, WIDEST), 1.0)


@ti.func
def width_at(water: ti.template(), company: ti.template(), box, y, x, unit):
    """Width [pixels] over which the water at a pixel is to be smoothed; 0 without water. unit: [m pixels]."""
    width = 0.0
    if box[1] <= y < box[3] and box[0] <= x < box[2]:
        key = water[y, x, 0]
        if depth_of(key) < 1e30:
            width = ti.min(company[ti.cast(key & 0x7FFFFFFF, ti.i32)] * unit / depth_of(key), WIDEST)
    return width


@ti.kernel
def settle(box: BOX, water: KEYS, company: SCALARS, depths: DEPTHS, reach: DEPTHS, spacing: ti.f32, focal: ti.f32):
    """Keys to depths [m] (FAR without water) and to the width [pixels] over which each is to be smoothed.

    Empty pixels close to water take its width, so that an outline is smoothed from both of its sides.
    """
    unit = WIDTH * spacing * focal
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        depths[y, x] = depth_of(water[y, x, 0])
        width = width_at(water, company, box, y, x, unit)
        if depths[y, x] > 1e30:
            for k in range(4):
                step = 3 if k % 2 == 0 else -3
                along = ti.Vector([step, 0]) if k < 2 else ti.Vector([0, step])
                near = width_at(water, company, box, y + along[0], x + along[1], unit)
                far = width_at(water, company, box, y + 3 * along[0], x + 3 * along[1], unit)
                width = ti.max(width, near, far)
        reach[y, x] = width


@ti.kernel
def vote(box: BOX, source: DEPTHS, target: DEPTHS, reach: DEPTHS, band: ti.f32):
    """Where merged water stands in front of other water, each pixel joins the layer that most of its neighbours show:
    so the inner outline loses the bumps of its particles."""
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        depth = source[y, x]
        if depth < 1e30 and reach[y, x] > VOTE:
            nearest, farthest = depth, depth
            for k in range(8):
                j, i = y + VOTE * (k % 3 - 1), x + VOTE * (k // 3 - 1)
                if box[1] <= j < box[3] and box[0] <= i < box[2]:
                    if source[j, i] < 1e30:
                        nearest, farthest = ti.min(nearest, source[j, i]), ti.max(farthest, source[j, i])
            if farthest - nearest > band:
                middle = 0.5 * (nearest + farthest)
                sums = ti.Vector([0.0, 0.0, 0.0, 0.0])
                for j in range(ti.max(y - VOTE, box[1]), ti.min(y + VOTE + 1, box[3])):
                    for i in range(ti.max(x - VOTE, box[0]), ti.min(x + VOTE + 1, box[2])):
                        if source[j, i] < middle:
                            sums += ti.Vector([source[j, i], 1.0, 0.0, 0.0])
                        elif source[j, i] < 1e30:
                            sums += ti.Vector([0.0, 0.0, source[j, i], 1.0])
                if sums[1] > sums[3]:
                    depth = depth if depth < middle else sums[0] / sums[1]
                else:
                    depth = depth if depth >= middle else sums[2] / sums[3]
        target[y, x] = depth


@ti.kernel
def smooth_depth(box: BOX, source: DEPTHS, target: DEPTHS, reach: DEPTHS, step_x: ti.i32, step_y: ti.i32, band: ti.f32):
    """One sweep of a Gaussian along a row or column, in mirrored pairs.

    A pair counts only while its mean lies within `band` [m] of the middle (narrow range: Truong & Yuksel 2018): a
    slope passes however steep it is, a step to other water does not.
    """
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        depth = source[y, x]
        value = depth
        if depth < 1e30:
            sigma = reach[y, x]
            total, weight = depth, 1.0
            for k in range(1, ti.cast(2.5 * sigma, ti.i32) + 1):
                ya, xa, yb, xb = y - k * step_y, x - k * step_x, y + k * step_y, x + k * step_x
                if ya < box[1] or xa < box[0] or yb >= box[3] or xb >= box[2]:
                    break
                mean = 0.5 * (source[ya, xa] + source[yb, xb])
                if ti.abs(mean - depth) > band:
                    break
                w = 2.0 * bell(k, sigma)
                total += w * mean
                weight += w
            value = total / weight
        target[y, x] = value


@ti.func
def body_at(cover: ti.template(), thick: ti.template(), y, x):
    """(coverage cut at 1, thickness [m]) of a pixel."""
    return ti.Vector([ti.min(cover[y, x] / FIXED, 1.0), thick[y, x] * DEPTH_UNIT])


@ti.func
def known(box, cover: ti.template(), facets: ti.template(), y, x, depth):
    """May water at `depth` be judged by this pixel, or does something nearer hide what is there?"""
    answer = box[1] <= y < box[3] and box[0] <= x < box[2]
    if answer:
        answer = cover[y, x] > 0 or facets[y, x][3] > depth
    return answer


@ti.kernel
def smooth_body(
    box: BOX,
    cover: LAYER,
    thick: LAYER,
    depths: DEPTHS,
    reach: DEPTHS,
    facets: FACETS,
    spacing: ti.f32,
    spare: BODY,
    body: BODY,
):
    """Coverage and thickness blurred along rows, then columns: the outline cover = 1/2 loses its particles' bumps."""
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        total, weight = body_at(cover, thick, y, x), 1.0
        sigma = OUTLINE * reach[y, x]
        near = depths[y, x] - 4.0 * spacing if depths[y, x] < 1e30 else 0.0
        for k in range(1, ti.cast(2.5 * sigma, ti.i32) + 1):
            w = bell(k, sigma)
            for side in range(2):
                i = x + k if side == 0 else x - k
                if known(box, cover, facets, y, i, near):
                    total += w * body_at(cover, thick, y, i)
                    weight += w
        spare[y, x] = total / weight
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        total, weight = spare[y, x], 1.0
        sigma = OUTLINE * reach[y, x]
        near = depths[y, x] - 4.0 * spacing if depths[y, x] < 1e30 else 0.0
        for k in range(1, ti.cast(2.5 * sigma, ti.i32) + 1):
            w = bell(k, sigma)
            for side in range(2):
                j = y + k if side == 0 else y - k
                if known(box, cover, facets, j, x, near):
                    total += w * spare[j, x]
                    weight += w
        body[y, x] = total / weight
