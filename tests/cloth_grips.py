"""Grips that slide sideways, as a guest of the cloth's substeps."""

import taichi as ti


@ti.data_oriented
class Grips:
    """Hold u of the first row, and after `stretch` of the last; v and w stay free."""

    def __init__(self, cloth, sheet):
        ni, self.nj = sheet.shape
        self.cloth, self.last = cloth, (ni - 1) * self.nj
        self.low, self.length = float(sheet.x[0, 0]), float(sheet.x[-1, 0] - sheet.x[0, 0])
        self.both, self.high = ti.field(ti.i32, ()), ti.field(ti.f64, ())

    def stretch(self, strain):
        """From now on hold the last row too."""
        self.both[None], self.high[None] = 1, self.low + self.length * (1.0 + strain)

    def begin(self, dt):
        """Nothing to prepare."""

    def end(self, dt):
        """Nothing to hand back."""

    @ti.func
    def predict(self, h):
        pass

    @ti.func
    def project(self, h):
        for j in range(self.nj):
            at = self.cloth.board.place(j)
            self.cloth.shift(at, ti.Vector([self.low - self.cloth.position(at)[0], 0.0, 0.0]))
            if self.both[None]:
                at = self.cloth.board.place(self.last + j)
                self.cloth.shift(at, ti.Vector([self.high[None] - self.cloth.position(at)[0], 0.0, 0.0]))

    @ti.func
    def finish(self, h):
        pass
