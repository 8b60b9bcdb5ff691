"""Water against walls: it fills a corner that balls round off, and lies flat on the glass that it is seen through."""

import numpy as np
import taichi as ti

from render.camera import BOX, VEC3, VIEW, ray
from render.opaque import IMAGE, solid_normal
from render.raster import FAR, KEYS, POINTS, TRIANGLES, depth_of, index_of
from render.splat import DEPTHS, merged_at

CLOSE = 0.9  # spacings from a wall within which a particle lies on it
FLAT = 4.0  # spacings: a triangle with a smaller height or width belongs to a round thing, or is no wall
WHOLE = 0.9  # of the width of smoothing that a body has: less are drops, which stay round
ON_GLASS = 1.0  # spacings behind glass within which water touches it


def images(x: np.ndarray, spacing: float, points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, ...]:
    """Mirror images of the particles x (n, 3) that lie on flat walls: (rows of x, places (k, 3), (normal, gap) (k, 4)).

    One behind each wall that a particle lies on, gap [m] away from it, and one behind both where walls make a corner.
    points (m, 3), triangles (t, 3): solids, turned outwards.
    """
    corners = points[triangles]
    ab, ac = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.cross(ab, ac)
    twice = np.linalg.norm(area, axis=1)
    longest = np.sqrt(np.max([(ab**2).sum(1), (ac**2).sum(1), ((ab - ac) ** 2).sum(1)], axis=0))
    close = CLOSE * spacing
    meets = (corners.min(1) < x.max(0) + close).all(1) & (corners.max(1) > x.min(0) - close).all(1)
    rows, places, planes = [], [], []
    for t in np.flatnonzero(meets & (twice > FLAT * spacing * longest)):
        normal = area[t] / twice[t]
        gap = (x - corners[t, 0]) @ normal
        near = np.flatnonzero((gap > 0.0) & (gap < close))
        from_a = x[near] - corners[t, 0]
        v = np.cross(from_a, ac[t]) @ area[t] / twice[t] ** 2
        w = np.cross(ab[t], from_a) @ area[t] / twice[t] ** 2
        near = near[(v >= 0.0) & (w >= 0.0) & (v + w <= 1.0)]
        step, plane = -2.0 * gap[near, None] * normal, np.column_stack([np.tile(normal, (len(near), 1)), gap[near]])
        for k in range(len(rows)):
            both, first, second = np.intersect1d(rows[k], near, assume_unique=True, return_indices=True)
            if planes[k][0, :3] @ normal < 0.5 and len(both):
                rows.append(both)
                places.append(places[k][first] + step[second])
                planes.append(planes[k][first])
        if len(near):
            rows.append(near)
            places.append(x[near] + step)
            planes.append(plane)
    if not rows:
        return np.zeros(0, np.int64), np.zeros((0, 3), np.float32), np.zeros((0, 4), np.float32)
    return np.concatenate(rows), *(np.concatenate(part).astype(np.float32) for part in (places, planes))


@ti.kernel
def lay_on_glass(
    view: VIEW,
    lens: VEC3,
    spacing: ti.f32,
    box: BOX,
    fronts: KEYS,
    inner: KEYS,
    backs: KEYS,
    water: KEYS,
    first_image: ti.i32,
    first_solid: ti.i32,
    solid_x: POINTS,
    solid_triangles: TRIANGLES,
    reach: DEPTHS,
    depths: DEPTHS,
    normals: IMAGE,
):
    """Water that touches the inside of glass has the glass's shape there, but for single drops.

    A pixel's ray enters the near wall at the first front face of glass (fronts), leaves it at the first back face
    (inner), and meets the far wall at the last front face (backs). first_image: of the rows that water names.
    """
    for y, x in ti.ndrange((box[1], box[3]), (box[0], box[2])):
        depth, leaves = depths[y, x], depth_of(inner[y, x, 0])
        if depth < FAR and leaves < FAR and leaves < depth_of(backs[y, x, 0]):
            outside = depth < depth_of(fronts[y, x, 0]) and index_of(water[y, x, 0]) < first_image
            way = (depth - leaves) * ray(view, lens, x + 0.5, y + 0.5).norm()
            merged = merged_at(reach[y, x], leaves, spacing, lens[0])
            if not outside and way < ON_GLASS * spacing and merged > WHOLE:
                depths[y, x] = leaves
                normals[y, x] = -solid_normal(index_of(inner[y, x, 0]) - first_solid, solid_x, solid_triangles)
