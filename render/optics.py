"""What a ray of sight does at water: it mirrors, bends, and is dyed; what it meets is looked up on the screen."""

import taichi as ti

from render.camera import project, row
from render.light import studio
from render.raster import depth_of

INDEX = 1.333  # of refraction
LENS = (0.9, 0.6)  # of a free body's full deflection, alone and merged: its far side is guessed from its near side
DARK = 0.7  # of the light is lost at the edge of a free body, whose rays go astray
DEEP = 0.06  # [m]: tint stops growing about here, or a tank would be a block of ink
SMEAR = 60.0  # [pixels] at most over which a free body's image of what lies far behind is averaged


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
    """Opaque colour about the image point `at`, mean of a square of side `blur` [pixels]; `straight` if anything that
    stands there is nearer than `nearest` [m]."""
    ix = ti.math.clamp(ti.cast(at[0] - 0.5, ti.i32), 0, image.shape[1] - 2)
    iy = ti.math.clamp(ti.cast(at[1] - 0.5, ti.i32), 0, image.shape[0] - 2)
    side = 4 if blur > 0.5 else 1
    colour = ti.Vector([0.0, 0.0, 0.0])
    for k in range(side * side):
        du, dv = (k % side + 0.5) / side - 0.5, (k // side + 0.5) / side - 0.5
        colour += fetch(image, at[0] + blur * du, at[1] + blur * dv) / (side * side)
    for k in range(16):
        if depth_of(keys[iy + k // 8, ix + (k // 4) % 2, k % 4]) < nearest:
            colour = straight
    return colour


@ti.func
def mirrored(image: ti.template(), keys: ti.template(), view, lens, p, direction, spacing, sky_colour):
    """What a mirror ray from p meets on the screen, by steps that grow; the sky if it meets nothing there."""
    colour, along, step = sky_colour, 1.5 * spacing, 1.5 * spacing
    start, way = view[:3, :] @ (p - row(view, 3)), view[:3, :] @ direction
    for _ in range(18):
        q = start + along * way
        u, v = lens[1] + lens[0] * q[0] / q[2], lens[2] - lens[0] * q[1] / q[2]
        if q[2] < 0.01 or not (0.0 <= u < image.shape[1] and 0.0 <= v < image.shape[0]):
            break
        past = q[2] - depth_of(keys[ti.cast(v, ti.i32), ti.cast(u, ti.i32), 0])
        if 0.0 < past < 3.0 * step + 4.0 * spacing:
            colour = fetch(image, u, v)
            break
        step *= 1.18
        along += step
    return colour


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
def refracted(
    image: ti.template(),
    keys: ti.template(),
    view,
    lens,
    to_sun,
    p,
    away,
    normal,
    straight,
    depth,
    room,
    water,
    free,
    merged,
    spacing,
    absorption,
):
    """Radiance that comes through the water at p: bent once onto what it rests on, twice if it hangs free in the air.

    straight: opaque colour of this pixel; room: way to that surface [m]; water: water on that way [m];
    absorption: of red, green and blue in it [1/m].
    """
    inside = bend(away, normal, 1.0 / INDEX)
    length = ti.min(water, room)
    level = ti.min(-away.dot(normal) / ti.max(-inside.dot(normal), 0.1), 1.0)
    leave = p + length * (free + (1.0 - free) * level) * inside
    out = bend(inside, 2.0 * normal.dot(away) * away - normal, INDEX)
    out = (inside + free * (away + (LENS[0] + (LENS[1] - LENS[0]) * merged) * (out - away) - inside)).normalized(1e-12)
    at = project(view, lens, leave + free * (room - length) * out)
    colour = behind(image, keys, at, straight, depth - spacing, free * ti.min(room / ti.max(water, 1e-6), SMEAR))
    if free > 0.0:
        border = ti.min(at[0], image.shape[1] - at[0], at[1], image.shape[0] - at[1])
        known = ti.math.clamp(border / 40.0, 0.0, 1.0) if out.dot(row(view, 2)) > 0.1 else 0.0
        colour += (studio(out, to_sun) - colour) * (1.0 - known) * free
    rim = 1.0 - free * DARK * ti.math.smoothstep(0.75, 0.2, -away.dot(normal))
    return rim * colour * ti.exp(-absorption * length / (1.0 + length / DEEP))
