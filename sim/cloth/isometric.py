"""Bending by second differences of position: a quadratic energy, so its stiffness never changes."""

from typing import NamedTuple

import numpy as np
import taichi as ti

from sim.cloth.board import LANES, Board
from sim.scene.cloth import Sheet


class Stencil(NamedTuple):
    """Nodes (i, j) + places[k] with factors[k], for every i, j that stays on the sheet; weight row[i] * column[j]."""

    places: tuple[tuple[int, int], ...]
    factors: tuple[float, ...]
    row: np.ndarray
    column: np.ndarray


def stencils(shape: tuple[int, int]) -> tuple[Stencil, ...]:
    """dxx, dyy and dxy over a sheet's nodes. Differences along a border have half a mesh's width; dxy counts twice."""
    ni, nj = shape
    half_i, half_j = np.ones(ni), np.ones(nj)
    half_i[[0, -1]], half_j[[0, -1]] = 0.5, 0.5
    along = ((0, 0), (1, 0), (2, 0), (2, 0)), (1.0, -2.0, 1.0, 0.0), np.ones(ni - 2), half_j
    across = ((0, 0), (0, 1), (0, 2), (0, 2)), (1.0, -2.0, 1.0, 0.0), half_i, np.ones(nj - 2)
    twist = ((0, 0), (1, 0), (0, 1), (1, 1)), (1.0, -1.0, -1.0, 1.0), np.full(ni - 1, 2.0), np.ones(nj - 1)
    return Stencil(*along), Stencil(*across), Stencil(*twist)


@ti.data_oriented
class Isometric:
    """E = (B/2) sum a^2 (|dxx x|^2 + |dyy x|^2 + 2 |dxy x|^2), f = -dE/dx = -Q (x + tau v), Q constant.

    Second differences on the grid: isotropic, and exact for a sheet rolled about an axis of the mesh. As stiff against
    stretch that varies as against bending; in a sheet whose springs are stiffer than B/a^2 that is nothing.
    Bergou et al. 2006 for the idea (bending of an inextensible sheet is quadratic), here without triangles.
    """

    def __init__(self, sheet: Sheet, board: Board):
        self.board, self.pitch = board, board.pitch
        self.present = sheet.bending > 0.0 and min(sheet.shape) > 2
        found = stencils(sheet.shape) if self.present else ()
        self.count = len(found)
        if not self.present:
            return
        self.place, self.factor = ti.field(ti.i32, (self.count, 4)), ti.field(board.real, (self.count, 4))
        self.rows, self.blocks = ti.field(ti.i32, self.count), ti.field(ti.i32, self.count)
        self.row = ti.field(board.real, (self.count, board.ni))
        self.column = ti.field(board.real, self.count * board.pitch)
        row, column = np.zeros((self.count, board.ni)), np.zeros((self.count, board.pitch))
        for n, s in enumerate(found):
            for k in range(4):
                self.place[n, k] = s.places[k][0] * board.pitch + s.places[k][1]
                self.factor[n, k] = s.factors[k]
            self.rows[n], self.blocks[n] = len(s.row), -(-len(s.column) // LANES)
            row[n, : len(s.row)] = sheet.bending / sheet.spacing**2 * s.row
            column[n, : len(s.column)] = s.column
        self.row.from_numpy(row.astype(board.numpy_real))
        self.column.from_numpy(column.ravel().astype(board.numpy_real))

    @ti.func
    def add(self, force: ti.template(), x: ti.template(), scale):
        """force += -scale Q x; every argument three fields of the board."""
        if ti.static(self.present):
            for i, n in ti.ndrange(self.board.ni, self.count):
                if i < self.rows[n]:
                    for block in range(self.blocks[n]):
                        column = block * LANES
                        k = scale * self.row[n, i] * self.board.get(self.column, n * self.pitch + column)
                        at = i * self.pitch + column
                        for d in ti.static(range(3)):
                            self._add(force[d], x[d], n, at, k)

    @ti.func
    def _add(self, force: ti.template(), x: ti.template(), n, at, k):
        p, q = at + self.place[n, 0], at + self.place[n, 1]
        r, s = at + self.place[n, 2], at + self.place[n, 3]
        fp, fq, fr, fs = self.factor[n, 0], self.factor[n, 1], self.factor[n, 2], self.factor[n, 3]
        get, put = ti.static(self.board.get, self.board.put)
        c = k * (fp * get(x, p) + fq * get(x, q) + fr * get(x, r) + fs * get(x, s))
        put(force, p, get(force, p) - fp * c)
        put(force, q, get(force, q) - fq * c)
        put(force, r, get(force, r) - fr * c)
        put(force, s, get(force, s) - fs * c)
