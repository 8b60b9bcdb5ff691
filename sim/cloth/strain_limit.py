"""No spring longer than (1 + limit) of its rest (Provot 1995): tethers to the clips here, springs in sim.cloth.sweep.

A tether |x - x_pin| <= (1 + limit) distance carries a pull from clip to node at once, where springs hand it on one
node a sweep (Kim, Chentanez & Mueller 2012).
"""

import numpy as np
import taichi as ti

from sim.cloth.board import LANES, Board
from sim.scene.cloth import Sheet

FREE = 1e6
"""[m] The tether of a node that a clip holds: it goes where the clip goes."""


@ti.data_oriented
class Tethers:
    """One a node, to the held node nearest on the flat sheet. None without clips or without a limit."""

    def __init__(self, sheet: Sheet, board: Board, strain_limit: float | None):
        self.board = board
        self.present = strain_limit is not None and len(sheet.pins) > 0
        if self.present:
            self.count = len(sheet.x)
            self.pin = ti.field(ti.i32, self.count)
            self.pin.from_numpy(sheet.pin_nearest.astype(np.int32))
            self.held = [ti.field(board.real, board.half) for _ in range(3)]
            self.longest = ti.field(board.real, board.half)
            reach = np.where(sheet.pin_distance > 0.0, (1.0 + strain_limit) * sheet.pin_distance, FREE)
            self.longest.from_numpy(board.laid_out(reach))

    @ti.func
    def begin(self):
        """Where the clips hold, for this step; after the board has been loaded."""
        if ti.static(self.present):
            for node in range(self.count):
                pin = self.board.vector(self.board.x, self.board.place(self.pin[node]))
                self.board.set_vector(self.held, self.board.place(node), pin)

    @ti.func
    def project(self):
        """Bring every node within its tether's reach, LANES at once."""
        if ti.static(self.present):
            for block in range(self.board.half // LANES):
                self._shorten(block * LANES)

    @ti.func
    def _shorten(self, at):
        hx, hy, hz = self.board.get_three(self.held, at)
        x, y, z = self.board.get_three(self.board.x, at)
        dx, dy, dz = x - hx, y - hy, z - hz
        length = ti.sqrt(dx * dx + dy * dy + dz * dz)
        over = 1.0 - ti.min(1.0, self.board.get(self.longest, at) / ti.max(length, 1e-12))
        self.board.put_three(self.board.x, at, x - over * dx, y - over * dy, z - over * dz)
