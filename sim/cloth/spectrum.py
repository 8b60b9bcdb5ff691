"""The fastest swing of a sheet, from its own masses and springs: what limits every explicit step. NumPy only."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sim.cloth.isometric import stencils
from sim.scene.cloth import Sheet, spring_list

ROUNDS = 60
"""Of Lanczos: the top of a 20 x 20 sheet is then right to 1e-4, of a 100 x 100 one to 1e-3."""
CUT = 64
"""Nodes along a side beyond which a sheet is looked at cut short: its top swing is the grid's own, or its edges'."""


def top_frequency(sheet: Sheet, springs: bool = True) -> float:
    """omega = sqrt(lambda_max(M^-1 K)) [rad/s] of the flat sheet at rest; springs=False: of its bending alone.

    Held nodes do not move; those of a sheet larger than CUT are let go, which can only raise omega (Rayleigh). By
    Lanczos' iteration (1950), the power method that keeps what it has seen.
    """
    shape, mass, stiffness = _whole(sheet, springs) if max(sheet.shape) <= CUT else _cut(sheet, springs)
    root = np.sqrt(mass)[:, None]
    q = np.random.default_rng(1).standard_normal((len(mass), 3)) * (root > 0.0)
    q, before, beta = q / np.linalg.norm(q), 0.0, 0.0
    diagonal, beside = [], []
    for _ in range(min(ROUNDS, 3 * int((mass > 0.0).sum()))):
        w = root * stiffness(root * q) - beta * before
        diagonal.append(float((w * q).sum()))
        w -= diagonal[-1] * q
        beta = float(np.linalg.norm(w))
        if beta <= 1e-12 * max(map(abs, diagonal)):
            break
        beside.append(beta)
        before, q = q, w / beta
    k = len(diagonal)
    t = np.diag(diagonal) + np.diag(beside[: k - 1], 1) + np.diag(beside[: k - 1], -1)
    return float(np.sqrt(max(np.linalg.eigvalsh(t)[-1], 0.0)))


def _whole(sheet: Sheet, springs: bool) -> tuple:
    """Shape, inverse masses, and K as a function of displacements (n, 3)."""
    return sheet.shape, sheet.inv_mass, stiffness_of(sheet, springs)


def _cut(sheet: Sheet, springs: bool) -> tuple:
    """The same of the sheet without its middle."""
    shape = tuple(min(n, CUT) for n in sheet.shape)
    families = tuple(
        f._replace(row=_ends(f.row, shape[0], sheet.shape[0]), column=_ends(f.column, shape[1], sheet.shape[1]))
        for f in sheet.families
    )
    keep = [np.r_[: n - n // 2, full - n // 2 : full] for n, full in zip(shape, sheet.shape)]
    pick = (keep[0][:, None] * sheet.shape[1] + keep[1]).ravel()
    u, v = np.divmod(np.arange(len(pick)), shape[1])
    uv = sheet.spacing * np.stack([u, v], -1)
    small = replace(sheet, shape=shape, families=families, mass=sheet.mass[pick], x=sheet.x[pick], uv=uv)
    return shape, 1.0 / small.mass, stiffness_of(small, springs)


def _ends(table: np.ndarray, short: int, whole: int) -> np.ndarray:
    """A family's row or column with its middle left out."""
    left = len(table) - (whole - short)
    return np.r_[table[: left - left // 2], table[len(table) - left // 2 :]]


def stiffness_of(sheet: Sheet, springs: bool = True) -> Callable[[np.ndarray], np.ndarray]:
    """u (n, 3) [m] -> K u [N], of springs at their rest lengths on the flat sheet, and of isometric bending."""
    found = spring_list(sheet)
    a, b = found.ends.T
    along = np.zeros((len(a), 3))
    along[:, :2] = sheet.uv[b] - sheet.uv[a]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    ni, nj = sheet.shape
    bent = stencils(sheet.shape) if sheet.bending > 0.0 and min(sheet.shape) > 2 else ()
    rigidity = sheet.bending / sheet.spacing**2

    def times(u: np.ndarray) -> np.ndarray:
        force = np.zeros_like(u)
        if springs:
            pull = (found.stiffness * ((u[b] - u[a]) * along).sum(1))[:, None] * along
            for d in range(3):
                force[:, d] = np.bincount(b, pull[:, d], len(u)) - np.bincount(a, pull[:, d], len(u))
        grid, out = u.reshape(ni, nj, 3), force.reshape(ni, nj, 3)
        for s in bent:
            m, n = len(s.row), len(s.column)
            weight = rigidity * np.outer(s.row, s.column)[..., None]
            cells = [(slice(p, p + m), slice(q, q + n)) for p, q in s.places]
            c = weight * sum(f * grid[cell] for f, cell in zip(s.factors, cells))
            for f, cell in zip(s.factors, cells):
                out[cell] += f * c
        return force

    return times
