"""Smoothing kernels W(r, H): radial, integral 1, zero from the support radius H on. Pure functions of (r, H).

Each has three: value W [1/m^3]; slope (dW/dr)/r [1/m^5], so that grad W = slope * (x_i - x_j) without a division; and
wall (lambda, dlambda/dd), the share of the kernel that lies beyond a plane at distance d,
lambda(d) = 2 pi int_d^H W(r) r (r - d) dr.  All run in Python and in Taichi alike; value and slope have no branch, so
that r may be a vector: of several distances at once.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import taichi as ti


class SmoothingKernel(NamedTuple):
    """value(r, H) [1/m^3], slope(r, H) [1/m^5], wall(d, H) -> (1, 1/m)."""

    value: Any
    slope: Any
    wall: Any


@ti.pyfunc
def wendland_c2(r, H):
    """W = 21/(2 pi H^3) (1 - q)^4 (1 + 4 q), q = r/H.   Wendland 1995; never pairs (Dehnen & Aly 2012)."""
    u = max(1.0 - r * (1.0 / H), 0.0)
    return 21.0 / (2.0 * math.pi) / (H * H * H) * (u * u) * (u * u) * (5.0 - 4.0 * u)


@ti.pyfunc
def wendland_c2_slope(r, H):
    """(dW/dr)/r = -20 * 21/(2 pi H^5) (1 - q)^3."""
    u = max(1.0 - r * (1.0 / H), 0.0)
    return -20.0 * 21.0 / (2.0 * math.pi) / (H * H * H * H * H) * u * u * u


@ti.pyfunc
def wendland_c2_wall(d, H):
    """lambda = 21 (U^6/6 - 3 U^7/14 + U^8/14), U = 1 - |d|/H; lambda(-d) = 1 - lambda(d)."""
    u = max(1.0 - abs(d) / H, 0.0)
    u5 = u * u * u * u * u
    share = 21.0 * u5 * u * (1.0 / 6.0 - u * (3.0 / 14.0 - u / 14.0))
    slope = -21.0 / H * u5 * (1.0 - u * (1.5 - u * (4.0 / 7.0)))
    return (share if d >= 0.0 else 1.0 - share), slope


@ti.pyfunc
def cubic_spline(r, H):
    """W = 8/(pi H^3) (1 - 6 q^2 + 6 q^3) up to q = 1/2, 16/(pi H^3) (1 - q)^3 beyond.   Monaghan 1992"""
    q = r * (1.0 / H)
    u, v = max(1.0 - q, 0.0), max(0.5 - q, 0.0)
    return 16.0 / math.pi / (H * H * H) * (u * u * u - 4.0 * v * v * v)


@ti.pyfunc
def cubic_spline_slope(r, H):
    """(dW/dr)/r = 48/(pi H^5) (3 q - 2) up to q = 1/2, -48/(pi H^5) (1 - q)^2/q beyond."""
    q = r * (1.0 / H)
    u, v = max(1.0 - q, 0.0), max(0.5 - q, 0.0)
    return -48.0 / math.pi / (H * H * H * H * H) * (u * u / max(q, 0.5) + 2.0 * q * v)


@ti.pyfunc
def cubic_spline_wall(d, H):
    """Piecewise polynomial of s = |d|/H; lambda(-d) = 1 - lambda(d)."""
    s = min(abs(d) / H, 1.0)
    u = 1.0 - s
    u4 = u * u * u * u
    share = 16.0 * u4 * u * (0.1 - u / 15.0)
    slope = -16.0 / H * u4 * (0.5 - 0.4 * u)
    if s < 0.5:
        s2 = s * s
        share = 0.5 - 16.0 * (0.0875 * s - s * s2 * (1.0 / 6.0 + s2 * (0.2 * s - 0.3)))
        slope = -16.0 / H * (0.0875 - s2 * (0.5 + s2 * (1.2 * s - 1.5)))
    return (share if d >= 0.0 else 1.0 - share), slope


@ti.pyfunc
def poly6(r, H):
    """W = 315/(64 pi H^3) (1 - q^2)^3, q = r/H.   Mueller 2003, eq. 20; flat at 0, so its gradient lets pairs form."""
    u = max(1.0 - r * r * (1.0 / (H * H)), 0.0)
    return 315.0 / (64.0 * math.pi) / (H * H * H) * u * u * u


@ti.pyfunc
def poly6_slope(r, H):
    """(dW/dr)/r = -945/(32 pi H^5) (1 - q^2)^2."""
    u = max(1.0 - r * r * (1.0 / (H * H)), 0.0)
    return -945.0 / (32.0 * math.pi) / (H * H * H * H * H) * u * u


@ti.pyfunc
def poly6_wall(d, H):
    """dlambda/dd = -315/256 (1 - s^2)^4/H, s = |d|/H; lambda(-d) = 1 - lambda(d)."""
    s = min(abs(d) / H, 1.0)
    s2 = s * s
    u2 = (1.0 - s2) * (1.0 - s2)
    odd = s * s2 * (1.0 / 3.0 - s2 * (0.6 - s2 * (3.0 / 7.0 - s2 / 9.0)))
    share = max(0.5 - 315.0 / 32.0 * (odd + s * u2 * u2 / 8.0), 0.0)
    return (share if d >= 0.0 else 1.0 - share), -315.0 / 256.0 / H * u2 * u2


@ti.pyfunc
def spiky(r, H):
    """W = 15/(pi H^3) (1 - q)^3.   Mueller 2003, eq. 21"""
    u = max(1.0 - r * (1.0 / H), 0.0)
    return 15.0 / math.pi / (H * H * H) * u * u * u


@ti.pyfunc
def spiky_slope(r, H):
    """(dW/dr)/r = -45/(pi H^5) (1 - q)^2/q: steepest at 0, so near pairs part; finite for points that coincide."""
    q = r * (1.0 / H)
    u = max(1.0 - q, 0.0)
    return -45.0 / math.pi / (H * H * H * H * H) * u * u / max(q, 1e-6)


@ti.pyfunc
def spiky_wall(d, H):
    """lambda = 3/2 U^5 - U^6, U = 1 - |d|/H; lambda(-d) = 1 - lambda(d)."""
    u = max(1.0 - abs(d) / H, 0.0)
    u4 = u * u * u * u
    share = u4 * u * (1.5 - u)
    return (share if d >= 0.0 else 1.0 - share), -u4 * (7.5 - 6.0 * u) / H


@ti.pyfunc
def mueller_wall(d, H):
    """lambda of poly6, dlambda/dd of spiky."""
    share, _ = poly6_wall(d, H)
    _, slope = spiky_wall(d, H)
    return share, slope


@ti.pyfunc
def viscosity_laplacian(r, H):
    """lap W = 45/(pi H^5) (1 - q), never negative: sum_j V_j (v_j - v_i) lap W -> lap v.   Mueller 2003, eq. 22"""
    return 45.0 / math.pi / (H * H * H * H * H) * max(1.0 - r * (1.0 / H), 0.0)


KERNELS = {
    "wendland_c2": SmoothingKernel(wendland_c2, wendland_c2_slope, wendland_c2_wall),
    "cubic_spline": SmoothingKernel(cubic_spline, cubic_spline_slope, cubic_spline_wall),
    "poly6": SmoothingKernel(poly6, poly6_slope, poly6_wall),
    "spiky": SmoothingKernel(spiky, spiky_slope, spiky_wall),
    "mueller": SmoothingKernel(poly6, spiky_slope, mueller_wall),
}
"""By name; fluid.kernel offers some of them. "mueller" is two of Mueller 2003: poly6 counts, spiky pushes."""


def lattice_points(support: float) -> list[tuple[int, int, int]]:
    """Points of the unit cubic lattice up to the support."""
    axis = range(-math.ceil(support), math.ceil(support) + 1)
    return [(i, j, k) for i in axis for j in axis for k in axis if i * i + j * j + k * k <= support * support]


def lattice_shares(kernel: SmoothingKernel, support: float) -> tuple[float, float]:
    """Sums of W dx^3 over the cubic lattice of spacing dx = H/support: (whole, the half-space z < 0 beyond a point).

    The whole is 1.034 for Wendland C2 at support 2: the kernel is divided by it, so that a lattice has density rho0.
    """
    whole = beyond = 0.0
    for p in lattice_points(support):
        w = kernel.value(math.dist(p, (0, 0, 0)), support)
        whole += w
        beyond += w if p[2] < 0 else 0.0
    return whole, beyond


def lattice_pull(kernel: SmoothingKernel, support: float, power: int = 0) -> float:
    """sum_j |dW/dr|/r (r/dx)^power dx^5 over the cubic lattice's neighbours, kernel normalised to it   [1]."""
    distances = [math.hypot(*p) for p in lattice_points(support) if any(p)]
    return -sum(float(kernel.slope(d, support)) * d**power for d in distances) / lattice_shares(kernel, support)[0]


def lattice_diagonal(kernel: SmoothingKernel, support: float) -> float:
    """sum_j |grad W|^2 dx^8 on the cubic lattice: what `diagonal` is inside of water, over m^2/dx^8   [1]."""
    r = np.array([p for p in lattice_points(support) if any(p)], float)
    distance = np.linalg.norm(r, axis=1)
    slope = np.array([kernel.slope(d, support) for d in distance]) / lattice_shares(kernel, support)[0]
    return float(((slope * distance) ** 2).sum())


def wall_fit(kernel: SmoothingKernel, support: float) -> tuple[float, float]:
    """(range, offset) [dx] of the wall that holds lattice water at rest: share wall(d + offset, range).

    At d = dx/2 it gives the lowest layer density rho0, and twice the pull of the layers above: these act on it with
    its own pressure and theirs, the wall with its own alone, since a wall has none. The true half-space
    (range = support, offset = 0) lets water sink in until something else carries a fifth of its weight.
    """
    whole, beyond = lattice_shares(kernel, support)
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        share, _ = kernel.wall(middle, 1.0)
        low, high = (middle, high) if share > beyond / whole else (low, middle)
    r = lattice_points(support)
    pull = sum(kernel.slope(math.dist(p, (0, 0, 0)), support) * p[2] for p in r if p[2] > 0)
    reach = kernel.wall(low, 1.0)[1] / (2.0 * pull / whole)
    return reach, low * reach - 0.5


def largest_eigenvalue(kernel: SmoothingKernel, support: float) -> float:
    """Of the diagonally scaled pressure operator on the cubic lattice: max |sum_j g_j sin(xi . r_j)|^2/sum_j |g_j|^2.

    g_j = grad W. Jacobi's relaxation must stay under 2 over it: 0.77 at support 2, 0.32 at 3 (Wendland C2).
    """
    r = np.array(lattice_points(support), float)
    distance = np.linalg.norm(r, axis=1)
    near = (distance > 0.0) & (distance < support)
    g = r[near] * np.array([kernel.slope(d, support) for d in distance[near]])[:, None]
    directions = np.array([(1, 0, 0), (1, 1, 0), (1, 1, 1), (2, 1, 0), (2, 1, 1)], float)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    waves = directions[:, None, :] * np.linspace(0.0, np.pi, 200)[None, :, None]
    sums = np.sin(waves @ r[near].T) @ g
    return float((sums**2).sum(-1).max() / (g**2).sum())
