"""Warp's mesh BVH (Macklin 2022) on the boxes of the bench, timed.

Run by an interpreter that has it, which need not have seep:

    python warp_boxes.py ORDER.npz FIGURES.json

ORDER: x (v, 3), triangles (t, 3), moved (v, 3): vertices [m] to build over and to refit to; points (n, 3), half [m]:
the queries are boxes of that half side around the points. Warp runs on one thread of the CPU.
"""

import json
import sys
import time

import numpy as np
import warp as wp

REPEATS = 5


@wp.kernel
def _count(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), half: float, found: wp.array(dtype=wp.int32)):
    i = wp.tid()
    reach = wp.vec3(half, half, half)
    query = wp.mesh_query_aabb(mesh, x[i] - reach, x[i] + reach)
    face = int(0)
    n = int(0)
    while wp.mesh_query_aabb_next(query, face):
        n += 1
    found[i] = n


def timed(act) -> dict[str, float]:
    """Medians of wall and CPU seconds; the first go compiles and is not counted."""
    act()
    laps = []
    for _ in range(REPEATS):
        wall, cpu = time.perf_counter(), time.process_time()
        act()
        laps.append((time.perf_counter() - wall, time.process_time() - cpu))
    return dict(zip(("wall", "cpu"), np.median(laps, axis=0).tolist()))


def main(order: str, figures: str) -> None:
    """Build, refit and ask, each timed; and how many triangles each point met, in all."""
    wp.config.quiet = True
    with np.load(order) as given, wp.ScopedDevice("cpu"):
        vertices = wp.array(given["x"], dtype=wp.vec3)
        triangles = wp.array(given["triangles"].reshape(-1), dtype=wp.int32)
        points, half = wp.array(given["points"], dtype=wp.vec3), float(given["half"])
        found = wp.zeros(len(points), dtype=wp.int32)
        mesh = wp.Mesh(vertices, triangles)
        told = {
            "version": wp.__version__,
            "query": timed(lambda: wp.launch(_count, len(points), [mesh.id, points, half, found])),
            "met": int(found.numpy().sum()),
            "build": timed(lambda: wp.Mesh(wp.array(given["x"], dtype=wp.vec3), triangles)),
        }
        wp.copy(mesh.points, wp.array(given["moved"], dtype=wp.vec3))
        told["refit"] = timed(mesh.refit)
    with open(figures, "w") as file:
        json.dump(told, file)


if __name__ == "__main__":
    main(*sys.argv[1:])
