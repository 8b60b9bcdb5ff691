"""All springs once, family by family, row by row: one Gauss-Seidel sweep of XPBD.

Rows are the lines between which springs of a family hang one below the other, so that within a row no two share a
node (see sim.cloth.board). One sweep a substep leaves the cloth too soft: when a spring is met, the one before it in
its line has just pulled its first node away by T h^2 w_a (T the tension), so that at rest its length is
T/k + T h^2 w_a instead of T/k: three times too long for dry cotton at h = 0.1 ms, fifty times at 0.5 ms.
Leaving w_a out of the denominator of every spring that has such a forerunner makes the line's length at rest exact;
it is over-relaxation by less than 2, hence as stable.
"""

import numpy as np
import taichi as ti

from sim.cloth.board import LANES, Board
from sim.maths.springs import limit_scale, spring_scale
from sim.scene.cloth import Family


@ti.data_oriented
class Sweep:
    """Tables of the families on a board. strain_limit: longest allowed strain, or None."""

    def __init__(self, families: tuple[Family, ...], board: Board, strain_limit: float | None):
        self.board, self.limited, self.strain_limit = board, strain_limit is not None, strain_limit
        self.along = sum(not f.across for f in families)
        self.count = len(families)
        ordered = sorted(families, key=lambda f: f.across)
        real, longest = board.real, max(board.pitch, board.turned_pitch)
        self.rest, self.first, self.second, self.rows, self.blocks = (
            ti.field(t, self.count) for t in (real, ti.i32, ti.i32, ti.i32, ti.i32)
        )
        self.stride = longest
        self.row, self.column, self.row_moved, self.column_moved = (
            ti.field(real, self.count * longest) for _ in range(4)
        )
        tables = np.zeros((4, self.count, longest))
        for n, family in enumerate(ordered):
            self._enter(n, family, tables[:, n])
        for field, table in zip((self.row, self.column, self.row_moved, self.column_moved), tables):
            field.from_numpy(table.ravel().astype(np.float64 if real == ti.f64 else np.float32))

    def _enter(self, n: int, family: Family, table: np.ndarray) -> None:
        b = self.board
        origin, pitch = (b.half, b.turned_pitch) if family.across else (0, b.pitch)
        first, second = (o[::-1] if family.across else o for o in (family.first, family.second))
        row, column = (family.column, family.row) if family.across else (family.row, family.column)
        self.rest[n] = family.rest
        self.first[n] = origin + first[0] * pitch + first[1]
        self.second[n] = origin + second[0] * pitch + second[1]
        self.rows[n], self.blocks[n] = len(row), -(-len(column) // LANES)
        table[0, : len(row)], table[1, : len(column)] = row, column
        # a spring has a forerunner unless its first node is where its line begins
        down, aside = second[0] - first[0], second[1] - first[1]
        table[2, down : len(row)] = 1.0
        table[3, max(aside, 0) : len(column) - max(-aside, 0)] = 1.0

    @ti.func
    def run(self, h):
        """Correct board.x for one substep of h seconds."""
        for n in range(self.count):
            if n == self.along:
                self.board.turn(False)
            pitch = self.board.pitch if n < self.along else self.board.turned_pitch
            for i in range(self.rows[n]):
                stiffness, moved = self.row[n * self.stride + i] * h * h, self.row_moved[n * self.stride + i]
                for block in range(self.blocks[n]):
                    self._correct(n, i * pitch, block * LANES, stiffness, moved)
        if self.along < self.count:
            self.board.turn(True)

    @ti.func
    def _correct(self, n, row_start, column, stiffness, moved):
        """LANES springs of family n, of which no two share a node."""
        p, q = self.first[n] + row_start + column, self.second[n] + row_start + column
        ax, ay, az, wa = self.board.get(self.board.x[0], p), self.board.get(self.board.x[1], p), self.board.get(self.board.x[2], p), self.board.get(self.board.w, p)
        bx, by, bz, wb = self.board.get(self.board.x[0], q), self.board.get(self.board.x[1], q), self.board.get(self.board.x[2], q), self.board.get(self.board.w, q)
        k = stiffness * self.board.get(self.column, n * self.stride + column)
        forerunner = moved * self.board.get(self.column_moved, n * self.stride + column)
        dx, dy, dz = bx - ax, by - ay, bz - az
        length, rest = ti.sqrt(dx * dx + dy * dy + dz * dz), self.rest[n]
        s = spring_scale(length, rest, k, wa, wb, forerunner)
        if ti.static(self.limited):
            longest = rest * (1.0 + self.strain_limit)
            s = ti.select((length > longest) & (k > 0.0), ti.max(s, limit_scale(length, longest, wa, wb)), s)
        sa, sb = s * wa, s * wb
        self.board.put(self.board.x[0], p, ax + sa * dx)
        self.board.put(self.board.x[1], p, ay + sa * dy)
        self.board.put(self.board.x[2], p, az + sa * dz)
        self.board.put(self.board.x[0], q, bx - sb * dx)
        self.board.put(self.board.x[1], q, by - sb * dy)
        self.board.put(self.board.x[2], q, bz - sb * dz)
