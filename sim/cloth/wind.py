"""Air that passes a sheet pushes it along and across."""

import numpy as np
import taichi as ti

from sim.cloth.board import pitch_of, place_of
from sim.constants import AIR_DENSITY
from sim.stage import Build

FACE_ON = 1.2
"""[1] Normal force of a plate across the flow, in rho_a |u|^2 A/2 (Hoerner 1965: 1.1 to 1.3 near square)."""
SKIN = 0.02
"""[1] Drag of both faces of a plate along the flow, in the same: rough and turbulent (Hoerner 1965)."""


@ti.data_oriented
class Wind:
    """On a triangle of area A that air passes at u:  f = rho_a A/2 |u| (C_N (u.n) n + C_F (u - (u.n) n)).

    Linear in the sine of the angle to the flow, so that nothing jumps where a flag swings through it. The wind is
    uniform and the sheet does not disturb it. A third on each corner, in every substep.   Hoerner 1965
    """

    reads, writes = ("cloth.x", "cloth.v"), ()

    def __init__(self, build: Build):
        sheet, nj = build.scene.sheet, build.scene.sheet.shape[1]
        self.parts, self.wind = build.parts, tuple(build.config.space.wind)
        self.corner = ti.Vector.field(3, ti.i32, len(sheet.triangles))
        self.corner.from_numpy(place_of(np.asarray(sheet.triangles, np.int32), nj, pitch_of(nj)))
        build.parts.setdefault("guests", []).append(self)

    def begin(self, dt: float) -> None:
        """Nothing to prepare."""

    def end(self, dt: float) -> None:
        """Nothing to hand back."""

    @ti.func
    def predict(self, h):
        """The force, before springs act: each corner moves by h^2 w f/3."""
        cloth, board = self.parts["cloth"], self.parts["cloth"].board
        for t in range(self.corner.shape[0]):
            at = self.corner[t]
            a = board.vector(board.start, at[0])
            across = (board.vector(board.start, at[1]) - a).cross(board.vector(board.start, at[2]) - a)
            u = ti.Vector([self.wind[0], self.wind[1], self.wind[2]], board.real)
            for k in ti.static(range(3)):
                u -= board.vector(board.v, at[k]) / 3.0
            area = 0.5 * across.norm()
            n = across / ti.max(2.0 * area, 1e-30)
            face_on = u.dot(n) * n
            force = 0.5 * AIR_DENSITY * area * u.norm() * (FACE_ON * face_on + SKIN * (u - face_on))
            for k in ti.static(range(3)):
                cloth.shift(at[k], h * h * board.w[at[k]] / 3.0 * force)

    @ti.func
    def project(self, h):
        pass

    @ti.func
    def finish(self, h):
        pass
