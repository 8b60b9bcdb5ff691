"""Self contact that holds: a thickness and friction within the substeps, and a last step that cannot be passed."""

import math

import numpy as np
import taichi as ti

from sim.cloth.elements import Elements
from sim.cloth.last_step import LastStep
from sim.cloth.near import Near
from sim.cloth.patch_pairs import PatchPairs
from sim.maths.ccd import EDGES, shares, spanned, within
from sim.model import Model, quantity
from sim.registry import register
from sim.stage import Build, Limit

THICKEST = 0.4
"""[spacings] Layers keep no farther apart: nodes two apart must be free to fold."""
RECOVERY = 0.05
"""[s] Layers that start a substep nearer than their thickness part over this time; it becomes no speed. At a fixed
0.1 m/s a pile at rest would keep 3e-5 of its energy for ever: what is pressed is parted and pressed again."""
SLACK = 0.5
"""[thickness] Pairs are listed this much before they touch, for what velocities at a step's start do not tell."""
OVERHANG = 0.05
"""[1] A node this far beside a triangle, or an edge's end, still counts: no gap is left between two triangles."""
COURANT = 0.5
"""[spacings] No node moves farther in a step against the sheet's mean: what whips by several meshes at a time is caught
by the last step alone, which tears it back."""
PARALLEL = 0.01
"""[rad] Edges at less than this have no direction across both; nodes over triangles keep them apart."""


@register("cloth.self_contact", "robust")
@ti.data_oriented
class Robust:
    """Nodes keep off triangles and edges off edges by the cloth's thickness, with Coulomb friction.   Bridson 2002

    Each substep corrects C = n . sum w_k x_k - d >= 0 for every near pair, where n and the weights w (1 and minus
    barycentrics, or the places along two edges) are those of the substep's start, by inverse mass. After the step
    continuous collision detection lets nothing pass (sim.cloth.last_step). Guest of a solver with a Board.
    """

    class Params(Model):
        """[cloth.robust]"""

        friction: float = quantity(0.4, ge=0, why="cotton on cotton; silk 0.2, terry 0.6")

    rows = ("cloth.x", "cloth.v", "cloth.inv_mass")
    scratch = ()
    reads, writes = rows, ()

    def __init__(self, build: Build, params: "Robust.Params"):
        sheet, config = build.scene.sheet, build.config.cloth
        self.parts, self.friction = build.parts, params.friction
        self.thickness = min(sheet.thickness, THICKEST * sheet.spacing)
        self.x, self.v = build.state["cloth.x"], build.state["cloth.v"]
        self.step_max = COURANT * sheet.spacing
        self.x0 = ti.Vector.field(3, float, shape=len(sheet.x))
        self.fall = float(np.linalg.norm(build.config.space.gravity))
        self.pairs = PatchPairs(sheet, self.x, config.search)
        elements = Elements(sheet)
        self.near = Near(self.pairs, elements, self.x, self.v, len(sheet.x))
        self.last = LastStep(build, self.pairs, elements, self.x0, 0.1 * self.thickness)
        build.parts.setdefault("guests", []).append(self)
        build.parts["self_contact"] = self

    def limit(self) -> Limit:
        """dt <= COURANT a/max |v - mean v|."""
        v = self.v.to_numpy()
        fastest = float(np.sqrt(((v - v.mean(0)) ** 2).sum(1).max()))
        return Limit(self.step_max / fastest if fastest > 0.0 else math.inf, "self contact")

    def begin(self, dt: float) -> None:
        """Who may meet whom in this step."""
        self.x0.copy_from(self.x)
        reach = self.thickness * (1.0 + SLACK) + 2.0 * self.fall * dt * dt
        self.pairs.ahead(self.v, dt, 0.5 * reach)
        self.near.find(reach, dt)

    def end(self, dt: float) -> None:
        """Nothing has passed."""
        self.pairs.cover(self.x0, 0.5 * self.thickness)
        self.last.run(dt)

    def counts(self) -> dict[str, int]:
        """Totals so far: crossings undone by the last step, one by one and by stopping a zone."""
        return {"parted": int(self.last.parted[None]), "carried": int(self.last.carried[None])}

    @ti.func
    def predict(self, h):
        pass

    @ti.func
    def finish(self, h):
        pass

    @ti.func
    def project(self, h):
        """One sweep over all near pairs."""
        board = self.parts["cloth"].board
        for c in range(self.near.count[None]):
            kind, four = ti.cast(self.near.kind[c], ti.i32), self.near.nodes[c]
            at = ti.Vector([board.place(four[k]) for k in ti.static(range(4))])
            a, b = board.vector(board.start, at[0]), board.vector(board.start, at[1])
            q, u, v = spanned(kind, a, b, board.vector(board.start, at[2]), board.vector(board.start, at[3]))
            n = u.cross(v)
            across = n.norm()
            n = n / ti.max(across, 1e-30)
            before = q.dot(n)
            if before < 0.0:
                n, before = -n, -before
            one, two, found = shares(kind, q, u, v)
            steep = across > PARALLEL * u.norm() * v.norm()
            if found and steep and within(kind, one, two, OVERHANG):
                self._part(board, at, self._weights(kind, one, two), n, before, h)

    @ti.func
    def _weights(self, kind, one, two):
        """w_k of the gap vector sum w_k x_k, from the second thing to the first."""
        w = ti.Vector([1.0, one + two - 1.0, -one, -two])
        if kind == EDGES:
            w = ti.Vector([one - 1.0, -one, 1.0 - two, two])
        return w

    @ti.func
    def _part(self, board: ti.template(), at, w, n, before, h):
        """Push to the thickness; then back along the surface by at most friction times as much.

        What was missing at the substep's start is made good slowly, and there too, so that it becomes no speed.
        """
        gap, resist = ti.cast(0.0, board.real), ti.cast(1e-30, board.real)
        moved, yielding = ti.Vector.zero(board.real, 3), ti.Vector.zero(board.real, 4)
        for k in ti.static(range(4)):
            x = board.vector(board.x, at[k])
            gap += w[k] * n.dot(x)
            moved += w[k] * (x - board.vector(board.start, at[k]))
            yielding[k] = w[k] * board.w[at[k]] * self._give(at[k], ti.math.sign(w[k]) * n)
            resist += w[k] * yielding[k]
        depth = self.thickness - gap
        if depth > 0.0 and resist > 1e-20:
            was = ti.min(ti.max(self.thickness - before, 0.0), depth)
            undone, fresh = was * ti.min(1.0, h / RECOVERY), depth - was
            slide = moved - moved.dot(n) * n
            held = ti.min(1.0, self.friction * fresh / ti.max(slide.norm(), 1e-12))
            push = ((fresh + undone) * n - held * slide) / resist
            for k in ti.static(range(4)):
                board.set_vector(board.x, at[k], board.vector(board.x, at[k]) + yielding[k] * push)
                start = board.vector(board.start, at[k]) + yielding[k] * undone / resist * n
                board.set_vector(board.start, at[k], start)

    @ti.func
    def _give(self, at, way):
        """1 for a node that is free to go `way`, down to 0 where a solid lies straight ahead: layers stack upwards.

        By mass alone a pile presses its lowest layer into the ground (0.4 mm of 25 cm, cotton).
        """
        ahead = ti.max(-self.parts["cloth"].contact.touch[at].dot(way), 0.0)
        return 1.0 - ahead * ahead
