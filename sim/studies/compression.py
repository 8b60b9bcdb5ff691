"""How far particles are pressed together, from their places alone: one measure for every program's frames."""

import numpy as np

from sim.maths.kernels import KERNELS, lattice_shares

SUPPORT = 3.0
"""[dx] Wider than any solver here uses, so that no solver is judged by its own sum, and disorder hardly counts: jitter
of 0.2 dx raises the sum of a lattice by 8 % at 2 dx and 1.1 % at 3 dx."""
KERNEL = KERNELS["wendland_c2"]
LATTICE = lattice_shares(KERNEL, SUPPORT)[0]
"""[1] Sum of W dx^3 over the cubic lattice."""


def densities(x: np.ndarray, spacing: float, low, high) -> np.ndarray:
    """rho/rho0 (n,) of places x (n, 3) [m] in a box from low to high: sum of W dx^3, 1 on the lattice.

    W is Wendland C2 with H = SUPPORT dx. The faces of the box are mirrors: a lattice that fills it has density 1
    up to the corners.
    """
    h = SUPPORT * spacing
    peak = 21.0 / (2.0 * np.pi) / SUPPORT**3 / LATTICE
    x = np.asarray(x, float)
    everything = _mirrored(x, h, low, high)
    total = np.zeros(len(x))
    for i, j in _pairs(everything, h, len(x)):
        q = np.minimum(np.linalg.norm(everything[i] - everything[j], axis=1) / h, 1.0)
        total += peak * np.bincount(i, (1.0 - q) ** 4 * (1.0 + 4.0 * q), len(x))
    return total


def mean_compression(x: np.ndarray, spacing: float, low, high) -> tuple[float, float]:
    """Means over the particles of max(rho/rho0 - 1, 0), and of rho/rho0, which falls as water swells and spreads."""
    density = densities(x, spacing, low, high)
    return float(np.maximum(density - 1.0, 0.0).mean()), float(density.mean())


def _mirrored(x: np.ndarray, reach: float, low, high) -> np.ndarray:
    """x, and after it the images of what is nearer than `reach` to a face; edges and corners get images of images."""
    for axis in range(3):
        images = [x]
        for face, near in ((low[axis], x[:, axis] < low[axis] + reach), (high[axis], x[:, axis] > high[axis] - reach)):
            image = x[near].copy()
            image[:, axis] = 2.0 * face - image[:, axis]
            images.append(image)
        x = np.concatenate(images)
    return x


def _pairs(x: np.ndarray, h: float, count: int):
    """(i, j) with i < count, in the same or in neighbouring cells of edge h, one cell offset at a time; i = j too."""
    cell = ((x - x.min(0)) / h).astype(np.int64) + 1
    shape = cell.max(0) + 2
    number = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    order = np.argsort(number, kind="stable")
    ranked = number[order]
    for offset in np.ndindex(3, 3, 3):
        away = ((offset[0] - 1) * shape[1] + offset[1] - 1) * shape[2] + offset[2] - 1
        first, stop = (np.searchsorted(ranked, number[:count] + away, side) for side in ("left", "right"))
        counts = stop - first
        i = np.repeat(np.arange(count), counts)
        yield i, order[np.arange(len(i)) + np.repeat(first - np.cumsum(counts) + counts, counts)]
