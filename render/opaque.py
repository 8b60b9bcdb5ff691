"""Ground, cloth and solids: one shaded colour a pixel from four depth samples, each surface in it shaded once."""

import taichi as ti

from render.camera import BOX, VEC3, VIEW, ray, row
from render.cloth import FILM_SHINE, THROUGH, UV, WETNESS, cloth_albedo
from render.ground import ground_albedo
from render.light import DIRECTIONS, NEAREST, SUN, VOLUME, ambient, dither, sky, sky_seen, sun_seen
from render.raster import EMPTY, FAR, KEYS, NEAR, POINTS, TRIANGLES, depth_of, edges, index_of, pack, sample_offset

GROUND = 0x7FFFFFFE  # ids: cloth triangles, then solids' (glass last), then these
SKY = 0x7FFFFFFF
NOTHING = SKY
CERAMIC = (0.36, 0.41, 0.44)
FROST = (0.60, 0.64, 0.67)
LIFT = 2.0  # texels of the sun's map off a surface, and as many towards the sun, so that it does not shade itself
IMAGE = ti.types.ndarray(dtype=VEC3, ndim=2)
VEC4 = ti.types.vector(4, ti.f32)
FACETS = ti.types.ndarray(dtype=VEC4, ndim=2)


@ti.func
def lit(albedo, normal, to_sun, sun, seen):
    """Diffuse radiance: sun by its visible fraction, sky and ground by theirs, and a little light from around."""
    direct = ti.Vector(SUN) * ti.max(normal.dot(to_sun), 0.0) * sun
    return albedo * (direct + ambient(normal) * (0.10 + 0.90 * seen))


@ti.func
def nearest_key(key, back, d, view, ground_z):
    """What a sample sees: cloth, else the solid's back, else the plane, merged by depth."""
    if back > 0:
        key = ti.min(key, back)
    depth = (ground_z - view[3, 2]) / d[2] if ti.abs(d[2]) > 1e-9 else FAR
    if NEAR < depth < depth_of(key):
        key = pack(depth, GROUND)
    return key


@ti.func
def bare(keys: ti.template(), backs: ti.template(), y, x, solids: ti.template()):
    """Does the pixel show the plane and the sky alone? Its checks are averaged exactly, so one sample serves."""
    answer = True
    for s in range(4):
        answer = answer and keys[y, x, s] == ti.i64(EMPTY)
        if ti.static(solids):
            answer = answer and backs[y, x, s] == 0
    return answer


@ti.func
def cloth_surface(
    index,
    d,
    eye,
    footprint,
    x: ti.template(),
    normals: ti.template(),
    wetness: ti.template(),
    uv: ti.template(),
    triangles: ti.template(),
    colour,
    hem,
):
    """(normal, albedo, shine in 0..1) where ray d meets a cloth triangle; the sheet's normal, of the face that d meets.

    Near an outline it may lean away from the eye, as the sheet is smoother than its triangles.
    """
    i, j, k = triangles[index][0], triangles[index][1], triangles[index][2]
    w = ti.max(edges(x[i] - eye, x[j] - eye, x[k] - eye) @ d, 0.0)
    w /= ti.max(w.sum(), 1e-20)
    normal = (w[0] * normals[i] + w[1] * normals[j] + w[2] * normals[k]).normalized(1e-12)
    wet = w[0] * wetness[i] + w[1] * wetness[j] + w[2] * wetness[k]
    slant = ti.max(ti.abs(normal.dot(d)) / d.norm(), 0.1)
    albedo = cloth_albedo(colour, w[0] * uv[i] + w[1] * uv[j] + w[2] * uv[k], hem, wet[0], footprint / slant)
    normal *= -1.0 if (x[j] - x[i]).cross(x[k] - x[i]).dot(d) > 0.0 else 1.0
    below = 1.0 if normal[2] < 0.0 else 0.0
    shine = 0.5 * ti.math.smoothstep(0.3, 1.0, wet[0]) + below * wet[1] / FILM_SHINE
    return normal, albedo, ti.min(shine, 1.0)


@ti.func
def solid_normal(index, x: ti.template(), triangles: ti.template()):
    """Flat normal of a triangle, out of the solid."""
    corner = triangles[index]
    a = x[corner[0]]
    return (x[corner[1]] - a).cross(x[corner[2]] - a).normalized(1e-20)


@ti.func
def surface(
    index,
    p,
    d,
    eye,
    footprint,
    tile,
    first_solid,
    cloth_x: ti.template(),
    cloth_normals: ti.template(),
    wetness: ti.template(),
    uv: ti.template(),
    cloth_triangles: ti.template(),
    colour,
    hem,
    solid_x: ti.template(),
    solid_triangles: ti.template(),
    cloth: ti.template(),
    solids: ti.template(),
):
    """(normal towards the eye, albedo, shine, part of the light that comes through) of what ray d meets at p."""
    normal, albedo, shine, through = ti.Vector([0.0, 0.0, 1.0]), ti.Vector(CERAMIC), 0.0, 0.0
    if index == GROUND:
        albedo = ground_surface(p, d / d.norm(), footprint, tile)
    if ti.static(cloth):
        if index < first_solid:
            normal, albedo, shine = cloth_surface(
                index, d, eye, footprint, cloth_x, cloth_normals, wetness, uv, cloth_triangles, colour, hem
            )
            through = THROUGH
    if ti.static(solids):
        if first_solid <= index < GROUND:
            normal = solid_normal(index - first_solid, solid_x, solid_triangles)
    if normal.dot(d) > 0.0 and index >= first_solid:
        normal = -normal
    return normal, albedo, shine, through


@ti.func
def facing_light(albedo, normal, away, to_sun, sun, open_sky, shine, through):
    """Radiance towards the eye: diffuse, what comes through from behind, and the gloss of a wet face."""
    facing = normal.dot(to_sun)
    colour = lit(albedo, normal, to_sun, sun, open_sky)
    if through > 0.0:
        colour += through * albedo * (ti.Vector(SUN) * ti.max(-facing, 0.0) * sun + 0.5 * ambient(-normal) * open_sky)
    if shine > 0.0:
        half = (to_sun - away).normalized(1e-12)
        cosine = -away.dot(normal)
        fresnel = 0.03 + 0.97 * (1.0 - ti.math.clamp(cosine, 0.0, 1.0)) ** 5
        gloss = 0.5 * sun * ti.math.clamp(4.0 * facing, 0.0, 1.0) * ti.max(half.dot(normal), 0.0) ** 60
        colour += shine * (0.6 * fresnel * open_sky * sky(away + 2.0 * cosine * normal) + gloss)
    return colour


@ti.func
def ground_surface(p, away, footprint, tile):
    """Albedo of the plane over what the pixel covers of it."""
    spread = footprint * (1.0 + ti.Vector([ti.abs(away[0]), ti.abs(away[1])]) / ti.max(ti.abs(away[2]), 1e-4))
    return ground_albedo(ti.Vector([p[0], p[1]]), spread, tile)


@ti.func
def hazed(colour, distance, fade, away):
    """Ground lost in the sky at its horizon."""
    far = distance / fade
    return colour + (sky(ti.Vector([away[0], away[1], 0.0])) - colour) * (1.0 - ti.exp(-far * far))


@ti.kernel
def shade_opaque(
    view: VIEW,
    lens: VEC3,
    to_sun: VEC3,
    tile: ti.f32,
    fade: ti.f32,
    ground_z: ti.f32,
    keys: KEYS,
    backs: KEYS,
    sun_view: VIEW,
    sun_lens: VEC3,
    sun_keys: KEYS,
    blocks_near: NEAREST,
    disc: DIRECTIONS,
    low: VEC3,
    cell: ti.f32,
    seen: VOLUME,
    first_solid: ti.i32,
    first_glass: ti.i32,
    cloth_x: POINTS,
    cloth_normals: POINTS,
    wetness: WETNESS,
    uv: UV,
    cloth_triangles: TRIANGLES,
    colour: VEC3,
    hem: VEC4,
    solid_x: POINTS,
    solid_triangles: TRIANGLES,
    image: IMAGE,
    facets: FACETS,
    cloth: ti.template(),
    solids: ti.template(),
):
    """Linear radiance of each pixel without water, and (normal, depth) of the farthest surface in it."""
    eye = row(view, 3)
    texel = ti.abs((eye - row(sun_view, 3)).dot(row(sun_view, 2))) / sun_lens[0]
    for y, x in ti.ndrange(keys.shape[0], keys.shape[1]):
        total, last, facet = ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 0.0]), ti.Vector([0.0, 0.0, 1.0])
        last_group, last_depth, farthest = -2, 0.0, 0.0
        count = 1 if bare(keys, backs, y, x, solids) else 4
        for s in range(count):
            at = sample_offset(s, count)
            d = ray(view, lens, x + at[0], y + at[1])
            key = nearest_key(keys[y, x, s], backs[y, x, s] if ti.static(solids) else ti.i64(0), d, view, ground_z)
            for k in range(s, s + 4 // count):
                keys[y, x, k] = key
            index, depth = index_of(key), depth_of(key)
            group = ti.max(index, first_solid - 1)
            if group != last_group or (index < first_solid and ti.abs(depth - last_depth) > 0.01 * depth):
                p, away = eye + depth * d, d / d.norm()
                normal, albedo, shine, through = surface(
                    index,
                    p,
                    d,
                    eye,
                    depth / lens[0],
                    tile,
                    first_solid,
                    cloth_x,
                    cloth_normals,
                    wetness,
                    uv,
                    cloth_triangles,
                    colour,
                    hem,
                    solid_x,
                    solid_triangles,
                    cloth,
                    solids,
                )
                last = sky(away)
                if index != SKY:
                    lifted = p + LIFT * texel * (to_sun + (normal if normal.dot(to_sun) > 0.0 else -normal))
                    sun = sun_seen(sun_keys, blocks_near, disc, sun_view, sun_lens, first_glass, lifted, dither(y, x))
                    open_sky = sky_seen(seen, low, cell, p + 0.9 * cell * normal)
                    last = facing_light(albedo, normal, away, to_sun, sun, open_sky, shine, through)
                    if index == GROUND:
                        last = hazed(last, (p - eye).norm(), fade, away)
                if depth > farthest:
                    facet = normal
            farthest = ti.max(farthest, depth)
            last_group, last_depth = group, depth
            total += last
        image[y, x] = total / count
        facets[y, x] = ti.Vector([facet[0], facet[1], facet[2], farthest])


@ti.kernel
def overlay_walls(
    view: VIEW,
    lens: VEC3,
    to_sun: VEC3,
    box: BOX,
    keys: KEYS,
    fronts: KEYS,
    first_solid: ti.i32,
    solid_x: POINTS,
    solid_triangles: TRIANGLES,
    image: IMAGE,
):
    """Solids in front of what they hold: frosted glass, so that water behind a wall is seen."""
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        colour = image[y, x]
        for s in range(4):
            key = fronts[y, x, s]
            if index_of(key) != NOTHING and depth_of(key) < depth_of(keys[y, x, s]) * 0.99999:
                normal = solid_normal(index_of(key) - first_solid, solid_x, solid_triangles)
                d = ray(view, lens, x + 0.5, y + 0.5).normalized(1e-20)
                veil = 0.13 + 0.6 * (1.0 - ti.abs(d.dot(normal))) ** 4 + 0.22 * ti.max(normal[2], 0.0)
                frost = lit(ti.Vector(FROST), normal, to_sun, 0.8, 0.9)
                colour += 0.25 * ti.min(veil, 0.9) * (frost - image[y, x])
        image[y, x] = colour
