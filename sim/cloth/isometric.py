"""Bending by second differences of position: a quadratic energy, so its stiffness never changes."""

from typing import NamedTuple

import numpy as np
import taichi as ti

from sim.cloth.board import LANES, Board
from sim.scene.cloth import Sheet

RING = 4
"""Rows of forces that `Isometric.add_row` has under way, at least; a power of two."""


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
        self.place, self.factor = ti.field(ti.i32, (self.count, 4, 2)), ti.field(board.real, (self.count, 4))
        self.rows, self.blocks = ti.field(ti.i32, self.count), ti.field(ti.i32, self.count)
        self.row = ti.field(board.real, (self.count, board.ni))
        self.column = ti.field(board.real, self.count * board.pitch)
        row, column = np.zeros((self.count, board.ni)), np.zeros((self.count, board.pitch))
        for n, s in enumerate(found):
            for k in range(4):
                self.place[n, k, 0], self.place[n, k, 1] = s.places[k]
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
            for i in range(self.board.ni):
                self.add_row(force, x, scale, i, -1)

    @ti.func
    def add_row(self, force: ti.template(), x: ti.template(), scale, i, mask):
        """The share of differences that begin in row i; none of them reaches beyond row i + 2.

        Row r of `force` stands at r & mask: -1 for a field of all rows, RING - 1 for one of the RING latest.
        """
        for n in range(self.count):
            if i < self.rows[n]:
                for block in range(self.blocks[n]):
                    column = block * LANES
                    k = scale * self.row[n, i] * self.board.get(self.column, n * self.pitch + column)
                    for d in ti.static(range(3)):
                        self._add(force[d], x[d], n, i, column, k, mask)

    @ti.func
    def _add(self, force: ti.template(), x: ti.template(), n, i, column, k, mask):
        get, put = ti.static(self.board.get, self.board.put)
        c = 0.0 * k
        for e in ti.static(range(4)):
            at = (i + self.place[n, e, 0]) * self.pitch + column + self.place[n, e, 1]
            c += self.factor[n, e] * get(x, at)
        c *= k
        for e in ti.static(range(4)):
            at = ((i + self.place[n, e, 0]) & mask) * self.pitch + column + self.place[n, e, 1]
            put(force, at, get(force, at) - self.factor[n, e] * c)
