"""No spring longer than (1 + limit) of its rest (Provot 1995): tethers to the clips here, springs in sim.cloth.sweep.

A tether |x - x_pin| <= (1 + limit) distance carries a pull from clip to node at once, where springs hand it on one
node a sweep (Kim, Chentanez & Mueller 2012).
"""

import numpy as np
import taichi as ti

from sim.cloth.board import Board
from sim.scene.cloth import Sheet


@ti.data_oriented
class Tethers:
    """One a free node, to the held node nearest on the flat sheet. None without clips or without a limit."""

    def __init__(self, sheet: Sheet, board: Board, strain_limit: float | None):
        self.board = board
        self.present = strain_limit is not None and len(sheet.pins) > 0
        if self.present:
            self.count = len(sheet.x)
            self.pin = ti.field(ti.i32, self.count)
            self.longest_sq = ti.field(float, self.count)
            self.pin.from_numpy(sheet.pin_nearest.astype(np.int32))
            self.longest_sq.from_numpy((((1.0 + strain_limit) * sheet.pin_distance) ** 2).astype(np.float32))

    @ti.func
    def project(self):
        """Bring every node within its tether's reach."""
        if ti.static(self.present):
            for node in range(self.count):
                at = self.board.place(node)
                held = self.board.vector(self.board.x, self.board.place(self.pin[node]))
                d = self.board.vector(self.board.x, at) - held
                length_sq = d.dot(d)
                if length_sq > self.longest_sq[node] and self.board.w[at] > 0.0:
                    self.board.set_vector(self.board.x, at, held + d * ti.sqrt(self.longest_sq[node] / length_sq))
