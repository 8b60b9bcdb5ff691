"""Which patches of a sheet may meet which: pairs whose boxes overlap."""

import numpy as np
import taichi as ti

from sim import runtime
from sim.errors import CapacityError
from sim.registry import method
from sim.scene.cloth import Sheet
from sim.search.boxes import overlap

FIRST_ROOM = 24
"""Partners a patch to begin with: itself, four neighbours, and those of a fold or two."""


@ti.data_oriented
class PatchPairs:
    """Boxes of patches on their way, and for each the partners q >= p whose boxes overlap its own, itself among them.

    low, high (p,) vec3   the boxes [m]
    count     (p,) i32    partners of a patch
    partner   i32         p * room + k; replaced by a longer one when a patch has more, so fetch it at each use and
                          hand it to kernels as a ti.template() argument
    """

    def __init__(self, sheet: Sheet, x, search: str):
        self.x, self.patch_count = x, len(sheet.patches)
        self.nodes = ti.Vector.field(4, ti.i32, shape=self.patch_count)
        self.nodes.from_numpy(np.asarray(sheet.patches, np.int32))
        self.low, self.high = (ti.Vector.field(3, float, shape=self.patch_count) for _ in range(2))
        self.count = ti.field(ti.i32, shape=self.patch_count)
        self.boxes = method("search.boxes", search)(self.patch_count)
        self.few = runtime.few(8 * self.patch_count)
        self._reserve(FIRST_ROOM)

    def _reserve(self, room: int) -> None:
        try:
            self.partner = ti.field(ti.i32, shape=room * self.patch_count)
        except RuntimeError as error:
            raise CapacityError(f"cloth: no memory for {room} partners a patch; use a larger cloth.spacing") from error
        self.room = room

    def ahead(self, v, dt: float, margin: float) -> None:
        """Pairs over the next dt seconds, going by velocities v; each box grown by margin [m]."""
        self._bound_ahead(v, dt, margin)
        self._list()

    def cover(self, x0, margin: float) -> None:
        """Pairs on the way x0 -> x that they have gone; listed anew only where a box was left."""
        if self._outside(x0):
            self._bound_way(x0, margin)
            self._list()

    def _list(self) -> None:
        self.boxes.build(self.low, self.high)
        wanted = self._find(self.partner, self.room)
        while wanted > self.room:
            self._reserve(wanted + wanted // 2)
            wanted = self._find(self.partner, self.room)

    @ti.func
    def _box(self, p, x: ti.template()):
        four = self.nodes[p]
        low, high = x[four[0]], x[four[0]]
        for k in ti.static(range(1, 4)):
            low, high = ti.min(low, x[four[k]]), ti.max(high, x[four[k]])
        return low, high

    @ti.kernel
    def _bound_ahead(self, v: ti.template(), dt: float, margin: float):
        ti.loop_config(serialize=self.few)
        for p in range(self.patch_count):
            four = self.nodes[p]
            low, high = self._box(p, self.x)
            for k in range(4):
                there = self.x[four[k]] + dt * v[four[k]]
                low, high = ti.min(low, there), ti.max(high, there)
            self.low[p], self.high[p] = low - margin, high + margin

    @ti.kernel
    def _bound_way(self, x0: ti.template(), margin: float):
        ti.loop_config(serialize=self.few)
        for p in range(self.patch_count):
            low0, high0 = self._box(p, x0)
            low1, high1 = self._box(p, self.x)
            self.low[p], self.high[p] = ti.min(low0, low1) - margin, ti.max(high0, high1) + margin

    @ti.kernel
    def _outside(self, x0: ti.template()) -> ti.i32:
        """How many patches are, or began, outside their boxes."""
        outside = 0
        for p in range(self.patch_count):
            low0, high0 = self._box(p, x0)
            low1, high1 = self._box(p, self.x)
            beyond = ti.max(self.low[p] - ti.min(low0, low1), ti.max(high0, high1) - self.high[p])
            if beyond.max() > 0.0:
                outside += 1
        return outside

    @ti.kernel
    def _find(self, partner: ti.template(), room: ti.i32) -> ti.i32:
        """Fill `partner`, numbers rising, so that it does not depend on the search; the most that a patch wants."""
        most = 0
        for p in range(self.patch_count):
            low, high, found = self.low[p], self.high[p], 0
            walk = self.boxes.begin(low, high)
            while walk[0] < walk[1]:
                walk, first, last = self.boxes.next(walk, low, high)
                for s in range(first, last):
                    q = self.boxes.slots[s]
                    if q >= p:
                        if overlap(low, high, self.low[q], self.high[q]):
                            found += self._enter(partner, p * room, ti.min(found, room), found < room, q)
            self.count[p] = found
            ti.atomic_max(most, found)
        return most

    @ti.func
    def _enter(self, partner: ti.template(), begin, known, space, q):
        """Put q in its place among the `known` first entries of a row; 1 if it was not there, and needs space."""
        at, new = known, 1
        while at > 0 and partner[begin + ti.max(at - 1, 0)] > q:
            at -= 1
        if at > 0 and partner[begin + ti.max(at - 1, 0)] == q:
            new = 0
        elif space:
            for m in range(known - at):
                partner[begin + known - m] = partner[begin + known - m - 1]
            partner[begin + at] = q
        return new
