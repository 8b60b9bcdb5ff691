"""All springs once, family by family: one Gauss-Seidel sweep of XPBD.

A family's springs hang in lines (down the columns, along the rows, along the diagonals). Each line is done in two
turns, every second spring and then the others. In running order, from one end to the other, a sweep is not its own
mirror image: it hands errors on in one direction, and a cloth with slack flutters by itself (measured on a 41 x 41
sheet with 15 % slack: 0.1 mm at 100 Hz, growing downstream, for ever; in two turns it comes to rest).
"""

import numpy as np
import taichi as ti

from sim.cloth.board import LANES, Board
from sim.maths.springs import limited_scale, spring_scale
from sim.scene.cloth import Family

CLEARING = 20
"""Sweeps at a step's end, at most, that only shorten springs beyond the limit. One that finds none is the last."""
ALLOWANCE = 0.002
"""Strain over the limit that is let be: less costs more sweeps."""


@ti.data_oriented
class Sweep:
    """Tables of the families on a board. strain_limit: longest allowed strain, or None."""

    def __init__(self, families: tuple[Family, ...], board: Board, strain_limit: float | None):
        self.board, self.limited, self.strain_limit = board, strain_limit is not None, strain_limit
        self.along = sum(not f.across for f in families)
        self.count = len(families)
        self.stride = max(board.pitch, LANES * (board.ni // LANES + 1), board.nj)
        self.rest = ti.field(board.real, self.count)
        self.excess = ti.field(board.real, ())
        self.first, self.second, self.rows, self.blocks = (ti.field(ti.i32, self.count) for _ in range(4))
        self.row, self.column = (ti.field(board.real, self.count * self.stride) for _ in range(2))
        tables = np.zeros((2, self.count, self.stride), board.numpy_real)
        for n, family in enumerate(sorted(families, key=lambda f: f.across)):
            self._enter(n, family, tables[:, n])
        self._line_up(sorted(families, key=lambda f: f.across))
        self.row.from_numpy(tables[0].ravel())
        self.column.from_numpy(tables[1].ravel())

    def _enter(self, n: int, family: Family, table: np.ndarray) -> None:
        b = self.board
        origin, pitch = (b.half, LANES) if family.across else (0, b.pitch)
        first, second = (o[::-1] if family.across else o for o in (family.first, family.second))
        row, column = (family.column, family.row) if family.across else (family.row, family.column)
        self.rest[n] = family.rest
        self.first[n] = origin + first[0] * pitch + first[1]
        self.second[n] = origin + second[0] * pitch + second[1]
        self.rows[n], self.blocks[n] = len(row), -(-len(column) // LANES)
        table[0, : len(row)], table[1, : len(column)] = row, column

    def _line_up(self, families: list[Family]) -> None:
        """How many rows each turn keeps behind the foremost: all that it meets has then been through those before it.

        All turns go down the sheet together, one behind the other, and do what they would do one after another; but a
        row is in the cache for all of them. On a sheet of a million nodes that halves the time.
        """
        self.behind = ti.field(ti.i32, 2 * self.count)
        self.reach = [0, 0]
        for n, family in enumerate(families):
            side = int(family.across)
            span = family.second[side] - family.first[side]
            for turn in (2 * n, 2 * n + 1):
                self.reach[side] += span
                self.behind[turn] = self.reach[side]

    @ti.func
    def run(self, h, elastic):
        """Correct board.x for one substep of h seconds.

        elastic: 1.0, or 0.0 for the strain limit alone, done at a step's end until `wanted` says no. Velocities stay as
        they are then; weighted by inverse mass, it moves no centre of mass.
        """
        for front in range(self.board.bands * LANES + self.reach[0]):
            band, left = (front - self.reach[0]) // LANES, (front - self.reach[0]) % LANES
            for side in range(2):  # springs from row to row; then those along the rows of a band that is left behind
                first, last, pitch, lines = 0, self.along, self.board.pitch, 1
                if side == 1:
                    first, last, pitch, lines = self.along, self.count, LANES, 0
                    if front >= self.reach[0] and left == LANES - 1:
                        lines = self.board.nj + self.reach[1]
                        self.board.turn(band, False)
                for line in range(lines):
                    for turn in range(2 * first, 2 * last):
                        n = turn // 2
                        i = (front if side == 0 else line) - self.behind[turn]
                        if i >= 0 and i < self.rows[n] and i % 2 == turn % 2:
                            stiffness = self.row[n * self.stride + i] * h * h
                            for block in range(self.blocks[n] if side == 0 else 1):
                                column = (block if side == 0 else band) * LANES
                                at = i * pitch + (column if side == 0 else 0)
                                self._correct(n, at, n * self.stride + column, stiffness, elastic)
                if lines > 1:
                    self.board.turn(band, True)

    @ti.func
    def wanted(self, clearing):
        """Whether to go on shortening, before sweep number `clearing` (from 0) of a step's end; resets the excess."""
        again = False
        if ti.static(self.limited):
            again = clearing == 0 or self.excess[None] > ALLOWANCE
            self.excess[None] = 0.0
        return again

    @ti.func
    def _correct(self, n, at, column, stiffness, elastic):
        """LANES springs of family n, of which no two share a node; column: where their share of stiffness stands."""
        p, q = self.first[n] + at, self.second[n] + at
        ax, ay, az = self.board.get_three(self.board.x, p)
        bx, by, bz = self.board.get_three(self.board.x, q)
        wa, wb = self.board.get(self.board.w, p), self.board.get(self.board.w, q)
        k = stiffness * self.board.get(self.column, column)
        dx, dy, dz = bx - ax, by - ay, bz - az
        length, rest = ti.sqrt(dx * dx + dy * dy + dz * dz), self.rest[n]
        s = wa
        if ti.static(self.limited):
            s = limited_scale(length, rest, rest * (1.0 + self.strain_limit), k, wa + wb, elastic)
        else:
            s = spring_scale(length, rest, k, wa + wb)
        sa, sb = s * wa, s * wb
        self.board.put_three(self.board.x, p, ax + sa * dx, ay + sa * dy, az + sa * dz)
        self.board.put_three(self.board.x, q, bx - sb * dx, by - sb * dy, bz - sb * dz)
        if ti.static(self.limited):
            if elastic == 0.0:  # last: a branch amid the vectors would break them up
                over = ti.min(length / rest - 1.0 - self.strain_limit, 1e30 * k * (wa + wb))
                self.excess[None] = ti.max(self.excess[None], over.max())
