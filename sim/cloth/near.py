"""Nodes and triangles, edges and edges of the sheet that may come within its thickness during a step."""

import taichi as ti

from sim.cloth.elements import Elements
from sim.cloth.patch_pairs import PatchPairs
from sim.errors import CapacityError
from sim.maths.ccd import EDGES, spanned

ROOM = 48
"""Near pairs a node that there is space for: a node deep in a pile has some ten."""


@ti.data_oriented
class Near:
    """kind[c], nodes[c] for c < count: see sim.maths.ccd. In the order of patches, so the same on any threads."""

    def __init__(self, pairs: PatchPairs, elements: Elements, x, v, node_count: int):
        self.pairs, self.elements, self.x, self.v = pairs, elements, x, v
        self.capacity = ROOM * node_count
        self.kind = ti.field(ti.i8, self.capacity)
        self.nodes = ti.Vector.field(4, ti.i32, self.capacity)
        self.count = ti.field(ti.i32, ())
        self._reserve()

    def _reserve(self) -> None:
        self.mask = ti.field(ti.i64, self.pairs.partner.shape[0])

    def find(self, reach: float, dt: float) -> None:
        """List what lies within `reach` [m], or may come so near in dt seconds at the speeds that nodes now have.

        CapacityError where there is more than ROOM a node: the mesh is finer than cloth of this thickness can use.
        """
        if self.mask.shape != self.pairs.partner.shape:
            self._reserve()
        self._mark(self.pairs.partner, self.pairs.room, self.mask, reach, dt)
        wanted = self._gather(self.pairs.partner, self.pairs.room, self.mask)
        if wanted > self.capacity:
            raise CapacityError(
                f"cloth: {wanted} pairs of nodes and edges are near each other, there is room for {self.capacity}; "
                "use a larger cloth.spacing or a smaller run.dt_max"
            )

    @ti.kernel
    def _mark(self, partner: ti.template(), room: ti.i32, mask: ti.template(), reach: float, dt: float):
        for p in range(self.pairs.patch_count):
            for k in range(self.pairs.count[p]):
                q = partner[p * room + k]
                bits = ti.cast(0, ti.i64)
                for t in range(self.elements.count(p, q)):
                    kind, four, fits = self.elements.test(p, q, t)
                    if fits:
                        if self._may_meet(kind, four, reach, dt):
                            bits |= ti.cast(1, ti.i64) << t
                mask[p * room + k] = bits

    @ti.func
    def _may_meet(self, kind, four, reach, dt):
        """Both bounds of their distance, by boxes and by the planes they span, within reach and their relative way."""
        a, b, c, d = self.x[four[0]], self.x[four[1]], self.x[four[2]], self.x[four[3]]
        mean = 0.25 * (self.v[four[0]] + self.v[four[1]] + self.v[four[2]] + self.v[four[3]])
        fastest = 0.0
        for k in ti.static(range(4)):
            fastest = ti.max(fastest, (self.v[four[k]] - mean).norm_sqr())
        most = reach + 2.0 * dt * ti.sqrt(fastest)
        low, high = a, a
        other_low, other_high = ti.min(c, d), ti.max(c, d)
        if kind == EDGES:
            low, high = ti.min(a, b), ti.max(a, b)
        else:
            other_low, other_high = ti.min(other_low, b), ti.max(other_high, b)
        apart = ti.max(0.0, other_low - high, low - other_high)
        near = apart.norm_sqr() < most * most
        if near:
            q, u, v = spanned(kind, a, b, c, d)
            near = ti.abs(q.dot(u.cross(v))) <= most * u.cross(v).norm() and not self._beside(kind, q, u, v, most)
        return near

    @ti.func
    def _beside(self, kind, q, u, v, most):
        """Whether seen along u x v they lie farther apart than `most`: beyond a side of the triangle, or of an edge.

        A flat sheet's boxes alone touch 2 to 6 times a node; its parts lie a spacing apart.
        """
        n = u.cross(v)
        beside = False
        for side in range(3):
            from_side, along, over = q, u, q
            if side == 1:
                along = -v
            if kind == EDGES:
                over = q + v if side == 0 else q - u
            elif side == 2:
                from_side, along = q - u, v - u
                over = from_side
            if kind != EDGES or side < 2:
                inward = n.cross(along)
                one, other, far = from_side.dot(inward), over.dot(inward), most * inward.norm()
                beside = beside or ti.max(one, other) < -far
                if kind == EDGES:
                    beside = beside or ti.min(one, other) > far
        return beside

    @ti.kernel
    def _gather(self, partner: ti.template(), room: ti.i32, mask: ti.template()) -> ti.i32:
        found = 0
        ti.loop_config(serialize=True)
        for p in range(self.pairs.patch_count):
            for k in range(self.pairs.count[p]):
                bits = mask[p * room + k]
                if bits != 0:
                    q = partner[p * room + k]
                    for t in range(self.elements.count(p, q)):
                        if (bits >> t) & 1:
                            kind, four, _ = self.elements.test(p, q, t)
                            if found < self.capacity:
                                self.kind[found], self.nodes[found] = ti.cast(kind, ti.i8), four
                            found += 1
        self.count[None] = ti.min(found, self.capacity)
        return found
