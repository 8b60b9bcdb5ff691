"""The shape of the water's surface on the screen: one smooth normal a pixel, and its rim where it wets a wall."""

import taichi as ti

from render.camera import BOX, VEC3, VIEW, ray, row
from render.opaque import FACETS, IMAGE
from render.raster import FAR, KEYS, POINTS
from render.splat import BODY, DEPTHS, bell, merged_at

BULGE = 0.85  # of a free merged body's normal is taken from its thickness, which is smoother than its near side
EDGE = 0.6  # coverage at the outline: over 1/2, as blurring cannot fill in beyond the outermost ball
RIM = (0.8, 2.5)  # tangent by which resting and free water tilt outwards at their very edge


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
def change(body: ti.template(), y, x):
    """Central differences of (cover, thickness) along x and along y [1/pixel]."""
    height, width = body.shape[0], body.shape[1]
    du = 0.5 * (body[y, ti.min(x + 1, width - 1)] - body[y, ti.max(x - 1, 0)])
    dv = 0.5 * (body[ti.min(y + 1, height - 1), x] - body[ti.max(y - 1, 0), x])
    return du, dv


@ti.func
def body_normal(body: ti.template(), view, away, y, x, texel):
    """Normal of a free body symmetric about the image plane: its near side bulges by half its thickness."""
    du, dv = change(body, y, x)
    scale = 0.5 / texel
    return (-away - scale * du[1] * row(view, 0) + scale * dv[1] * row(view, 1)).normalized(1e-12)


@ti.func
def coverage(body: ti.template(), y, x):
    """How much of the pixel lies inside the outline cover = EDGE, from its distance over its gradient."""
    du, dv = change(body, y, x)
    gradient = ti.sqrt(du[0] * du[0] + dv[0] * dv[0])
    return ti.math.clamp(0.5 + (body[y, x][0] - EDGE) / ti.max(gradient, 0.02), 0.0, 1.0)


@ti.func
def rimmed(normal, body: ti.template(), view, y, x, free, merged):
    """Normal rounded off towards the outline: the bead where resting water ends, the round side of a free drop."""
    du, dv = change(body, y, x)
    outward = -du[0] * row(view, 0) + dv[0] * row(view, 1)
    outward -= outward.dot(normal) * normal
    edge = ti.math.clamp((1.0 - body[y, x][0]) / (1.0 - EDGE), 0.0, 1.0)
    tilt = merged * edge * (RIM[0] + (RIM[1] - RIM[0]) * free)
    return (normal + tilt * outward / (outward.norm() + 0.02)).normalized(1e-12)


@ti.func
def hanging(room, water, slant, spacing):
    """0 for water that rests on the surface behind it, 1 for water free in the air.

    room: way to that surface [m]; water: water on that way [m]; slant: cosine between that way and its normal.
    """
    return ti.math.smoothstep(2.0, 5.0, slant * (room - water) / spacing)


@ti.kernel
def shape(
    x: POINTS,
    box: BOX,
    view: VIEW,
    lens: VEC3,
    spacing: ti.f32,
    water: KEYS,
    depths: DEPTHS,
    reach: DEPTHS,
    body: BODY,
    facets: FACETS,
    normals: IMAGE,
):
    """Normal of each water pixel: a ball's when alone, a bulge when free, its bed's when a film, else the slope's."""
    for v, u in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        depth = depths[v, u]
        if depth < FAR:
            d = ray(view, lens, u + 0.5, v + 0.5)
            away, facet = d.normalized(1e-12), facets[v, u]
            bed = ti.Vector([facet[0], facet[1], facet[2]])
            room = ti.max(facet[3] - depth, 0.0) * d.norm()
            slant = ti.abs(bed.dot(away))
            free, merged = hanging(room, body[v, u][1], slant, spacing), merged_at(reach[v, u], depth, spacing, lens[0])
            normal = water_normal(depths, view, lens, v, u, 2.0 * spacing)
            normal += BULGE * free * merged * (body_normal(body, view, away, v, u, depth / lens[0]) - normal)
            film = 1.0 - ti.math.smoothstep(1.2, 3.0, room * slant / spacing)
            normal += film * merged * (1.0 - free) * (bed - normal)
            i = ti.cast(water[v, u, 0] & 0x7FFFFFFF, ti.i32)
            ball = (row(view, 3) + depth * d - x[i]).normalized(1e-12)
            normals[v, u] = (normal + (1.0 - merged) * (ball - normal)).normalized(1e-12)


@ti.kernel
def smooth_normals(
    source: IMAGE,
    target: IMAGE,
    box: BOX,
    depths: DEPTHS,
    reach: DEPTHS,
    step_x: ti.i32,
    step_y: ti.i32,
    band: ti.f32,
):
    """One sweep of a Gaussian along a row or column over the water within `band` [m] of depth."""
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        depth = depths[y, x]
        if depth < FAR:
            total, sigma = source[y, x], 0.6 * reach[y, x]
            for k in range(1, ti.cast(2.5 * sigma, ti.i32) + 1):
                w = bell(k, sigma)
                for side in ti.static((-1, 1)):
                    j, i = y + side * k * step_y, x + side * k * step_x
                    if box[1] <= j < box[3] and box[0] <= i < box[2]:
                        if ti.abs(depths[j, i] - depth) < band:
                            total += w * source[j, i]
            target[y, x] = total.normalized(1e-12)
