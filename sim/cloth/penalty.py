"""Self contact as the 2019 report had it: a spring pushes nodes off patches. Kept to show what it does: it claps."""

import numpy as np
import taichi as ti

from sim.cloth.elements import Elements
from sim.cloth.near import Near
from sim.cloth.patch_pairs import PatchPairs
from sim.maths.ccd import POINT, shares, spanned, within
from sim.model import Model, quantity
from sim.registry import register
from sim.stage import Build


@register("cloth.self_contact", "penalty")
@ti.data_oriented
class Penalty:
    """f = stiffness (reach - gap) on a node over a triangle, along its Gouraud normal; no damping, no friction, and
    nothing on the triangle: what clapped in the 2019 report. Fast nodes pass through.

    gap is signed by the side on which the node is now; the normal is interpolated from those of the corners, as they
    were at the step's start. Guest of a solver with a Board.
    """

    class Params(Model):
        """[cloth.penalty]"""

        stiffness: float = quantity("5 N/m", gt=0, why="of a node; 1.5e-5 kg of cotton then swing with 90 Hz")
        reach: float = quantity("3 mm", "length", gt=0, why="as far as nodes of the report's small cloth were pushed")

    rows = ("cloth.x", "cloth.v", "cloth.inv_mass")
    scratch = ()
    reads, writes = rows, ()

    def __init__(self, build: Build, params: "Penalty.Params"):
        sheet = build.scene.sheet
        self.parts, self.stiffness, self.reach = build.parts, params.stiffness, params.reach
        self.x, self.v = build.state["cloth.x"], build.state["cloth.v"]
        self.fall = float(np.linalg.norm(build.config.space.gravity))
        self.pairs = PatchPairs(sheet, self.x, build.config.cloth.search)
        self.near = Near(self.pairs, Elements(sheet), self.x, self.v, len(sheet.x))
        self.corner = ti.Vector.field(3, ti.i32, len(sheet.triangles))
        self.corner.from_numpy(np.asarray(sheet.triangles, np.int32))
        self.normal = ti.Vector.field(3, float, len(sheet.x))
        build.parts.setdefault("guests", []).append(self)
        build.parts["self_contact"] = self

    def begin(self, dt: float) -> None:
        """Who may come near whom, and the normals of nodes."""
        reach = self.reach + 2.0 * self.fall * dt * dt
        self.pairs.ahead(self.v, dt, 0.5 * reach)
        self.near.find(reach, dt)
        self._normals()

    def end(self, dt: float) -> None:
        """Nothing to hand back."""

    def counts(self) -> dict[str, int]:
        """Nothing is undone: what passes has passed."""
        return {}

    @ti.kernel
    def _normals(self):
        ti.loop_config(serialize=True)
        for n in range(self.normal.shape[0]):
            self.normal[n] = 0.0
        ti.loop_config(serialize=True)
        for t in range(self.corner.shape[0]):
            c = self.corner[t]
            across = (self.x[c[1]] - self.x[c[0]]).cross(self.x[c[2]] - self.x[c[0]])
            for k in ti.static(range(3)):
                self.normal[c[k]] += across

    @ti.func
    def predict(self, h):
        """The force, before the move."""
        board = self.parts["cloth"].board
        for c in range(self.near.count[None]):
            if ti.cast(self.near.kind[c], ti.i32) == POINT:
                four = self.near.nodes[c]
                at = ti.Vector([board.place(four[k]) for k in ti.static(range(4))])
                x, weight = board.vector(board.x, at[0]), board.w[at[0]]
                a, b = board.vector(board.x, at[1]), board.vector(board.x, at[2])
                q, u, v = spanned(POINT, x, a, b, board.vector(board.x, at[3]))
                one, two, found = shares(POINT, q, u, v)
                if found and weight > 0.0 and within(POINT, one, two, 0.0):
                    n = (1.0 - one - two) * self.normal[four[1]] + one * self.normal[four[2]]
                    n = (n + two * self.normal[four[3]]).normalized(1e-30)
                    gap = q.dot(n)
                    depth = self.reach - ti.abs(gap)
                    if depth > 0.0:
                        push = h * h * weight * self.stiffness * depth * ti.math.sign(gap)
                        board.set_vector(board.x, at[0], x + push * n)

    @ti.func
    def project(self, h):
        pass

    @ti.func
    def finish(self, h):
        pass
