"""A moving point and a moving triangle, made by formula: as in a scene, and hard to tell."""

import numpy as np


def queries(count: int) -> dict[str, np.ndarray]:
    """By kind, (count, 8, 3) f32, exact: v, f0, f1, f2 at t0, then at t1 [m].

    scene       water on its way to a moving patch of 5 mm, or past it: half of them meet
    scattered   a point flung past a tumbling triangle, from a wide field
    lattice     corners of a coarse lattice: edges, corners and planes met exactly, triangles without area
    sliding     in the plane of a triangle that turns about itself
    resting     on the triangle or 1e-7 beside it, all moving together
    turning     into the plane and out again: a double root, or just none
    """
    random = np.random.default_rng(11)
    lattice = random.integers(-2, 3, (count, 8, 3)) / 4.0
    flat = random.integers(-4, 5, (count, 8, 3)) / 8.0
    flat[..., 2] = 0.25
    corners = random.uniform(-0.1, 0.1, (count, 3, 3)).astype(np.float32)
    share = random.dirichlet(np.ones(3), count)[:, :, None]
    on = (share * corners).sum(1) + random.choice([0.0, 1e-7], (count, 1)) * random.standard_normal((count, 3))
    resting = np.concatenate([on[:, None], corners, on[:, None], corners], 1)
    resting[:, 4:] += random.uniform(-1e-3, 1e-3, (count, 1, 3))
    turning = random.integers(-2, 3, (count, 8, 3)) / 4.0
    turning[:, 1:4, 2], turning[:, 5:, 2] = 0.0, 0.0
    turning[:, 0, 2], turning[:, 4, 2] = 0.25, 0.25
    turning[:, 6, 2] = random.integers(0, 9, count) / 8.0
    scattered = random.uniform(-0.2, 0.2, (count, 8, 3))
    kinds = {"scene": _scene(count), "scattered": scattered}
    kinds |= {"lattice": lattice, "sliding": flat, "resting": resting, "turning": turning}
    return {kind: v.astype(np.float32) for kind, v in kinds.items()}


def _scene(count: int) -> np.ndarray:
    random = np.random.default_rng(12)
    patch = np.array([[0.0, 0.0, 0.0], [5e-3, 0.0, 0.0], [0.0, 5e-3, 0.0]])
    triangle = patch + random.uniform(-0.1, 0.1, (count, 1, 3)) + random.normal(0.0, 5e-4, (count, 3, 3))
    before = triangle.mean(1) + random.normal(0.0, 1.5e-3, (count, 3))
    after = 2.0 * triangle.mean(1) - before + random.normal(0.0, 1e-3, (count, 3))
    moved = triangle + random.uniform(-1e-3, 1e-3, (count, 1, 3)) + random.normal(0.0, 1e-4, (count, 3, 3))
    return np.concatenate([before[:, None], triangle, after[:, None], moved], 1)
