"""Springs as forces: what the solvers that know no constraints sum up, LANES springs at once."""

import numpy as np
import taichi as ti

from sim.cloth.board import LANES, Board
from sim.scene.cloth import Family


@ti.data_oriented
class SpringForces:
    """f_a = k (|d| - L + tau d(|d|)/dt) d/|d| = -f_b, d = x_b - x_a: springs and dashpots side by side (Kelvin, Voigt).

    k [N/m] and L [m] from the sheet's families, tau [s] the fabric's retardation time. Lines are added one after
    another in a fixed order, so the same bits come out on any number of threads.
    """

    def __init__(self, families: tuple[Family, ...], board: Board):
        self.board, self.count, self.pitch = board, len(families), board.pitch
        self.rest = ti.field(board.real, self.count)
        self.first, self.second, self.rows, self.blocks = (ti.field(ti.i32, self.count) for _ in range(4))
        self.row = ti.field(board.real, (self.count, board.ni))
        self.column = ti.field(board.real, self.count * board.pitch)
        row, column = np.zeros((self.count, board.ni)), np.zeros((self.count, board.pitch))
        for n, family in enumerate(families):
            self.rest[n] = family.rest
            self.first[n] = family.first[0] * board.pitch + family.first[1]
            self.second[n] = family.second[0] * board.pitch + family.second[1]
            self.rows[n], self.blocks[n] = len(family.row), -(-len(family.column) // LANES)
            row[n, : len(family.row)], column[n, : len(family.column)] = family.row, family.column
        self.row.from_numpy(row.astype(board.numpy_real))
        self.column.from_numpy(column.ravel().astype(board.numpy_real))

    @ti.func
    def add(self, force: ti.template(), x: ti.template(), retardation):
        """force [N] += that of every spring between the places x [m]; velocities are the board's."""
        for i, n in ti.ndrange(self.board.ni, self.count):  # row by row: what all families meet is then in the cache
            if i < self.rows[n]:
                for block in range(self.blocks[n]):
                    column = block * LANES
                    stiffness = self.row[n, i] * self.board.get(self.column, n * self.pitch + column)
                    p = self.first[n] + i * self.pitch + column
                    self._add(force, x, p, p + self.second[n] - self.first[n], stiffness, self.rest[n], retardation)

    @ti.func
    def _add(self, force: ti.template(), x: ti.template(), p, q, stiffness, rest, retardation):
        ax, ay, az = self.board.get_three(x, p)
        bx, by, bz = self.board.get_three(x, q)
        ux, uy, uz = self.board.get_three(self.board.v, p)
        vx, vy, vz = self.board.get_three(self.board.v, q)
        dx, dy, dz = bx - ax, by - ay, bz - az
        length_sq = ti.max(dx * dx + dy * dy + dz * dz, 1e-24)
        rate = ((vx - ux) * dx + (vy - uy) * dy + (vz - uz) * dz) / length_sq
        s = stiffness * (1.0 - rest / ti.sqrt(length_sq) + retardation * rate)
        fx, fy, fz = self.board.get_three(force, p)
        self.board.put_three(force, p, fx + s * dx, fy + s * dy, fz + s * dz)
        gx, gy, gz = self.board.get_three(force, q)
        self.board.put_three(force, q, gx - s * dx, gy - s * dy, gz - s * dz)

    @ti.func
    def add_change(self, force: ti.template(), x: ti.template(), u: ti.template(), scale, forces):
        """force += scale (K(x) u - forces f(x)): by how much less springs pull where the places x are moved by u.

        K = k (n n^T + max(0, 1 - L/|d|) (1 - n n^T)), n = d/|d|: what is negative across a short spring is left out.
        """
        for i, n in ti.ndrange(self.board.ni, self.count):
            if i < self.rows[n]:
                for block in range(self.blocks[n]):
                    column = block * LANES
                    stiffness = scale * self.row[n, i] * self.board.get(self.column, n * self.pitch + column)
                    p = self.first[n] + i * self.pitch + column
                    self._add_change(
                        force, x, u, p, p + self.second[n] - self.first[n], stiffness, self.rest[n], forces
                    )

    @ti.func
    def _add_change(self, force: ti.template(), x: ti.template(), u: ti.template(), p, q, stiffness, rest, forces):
        ax, ay, az = self.board.get_three(x, p)
        bx, by, bz = self.board.get_three(x, q)
        ux, uy, uz = self.board.get_three(u, p)
        vx, vy, vz = self.board.get_three(u, q)
        dx, dy, dz = bx - ax, by - ay, bz - az
        ex, ey, ez = vx - ux, vy - uy, vz - uz
        length_sq = ti.max(dx * dx + dy * dy + dz * dz, 1e-24)
        strain = 1.0 - rest / ti.sqrt(length_sq)
        across = ti.max(strain, 0.0)
        along = (1.0 - across) * (ex * dx + ey * dy + ez * dz) / length_sq + forces * strain
        gx, gy, gz = (
            stiffness * (along * dx + across * ex),
            stiffness * (along * dy + across * ey),
            stiffness * (along * dz + across * ez),
        )
        fx, fy, fz = self.board.get_three(force, p)
        self.board.put_three(force, p, fx - gx, fy - gy, fz - gz)
        hx, hy, hz = self.board.get_three(force, q)
        self.board.put_three(force, q, hx + gx, hy + gy, hz + gz)
