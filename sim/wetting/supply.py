"""From water that touches the sheet to the patches under it: demand meets supply, in whole mass units.

A particle stands for its volume as a puddle of height 2 l_c sin(theta/2) (de Gennes 1985), or dx if that is less, so
that the area wetted by so much water does not depend on the size of particles. The puddle is spread over the patches
under it by a tent in material coordinates; a patch's demand is shared by that cover, and scaled down where a particle
has less than is asked of it. So a particle may be larger than a patch can hold. Of those that cover a patch the
lightest gives most: a few are used up and merge, rather than all becoming light, which SPH bears badly.
"""

import math

import numpy as np
import taichi as ti
import taichi.math as tm

from sim.constants import MASS_UNIT
from sim.maths.facet import plane_gap
from sim.scene.puddle import TOUCH, film_height

ZEAL = 4
"""A particle of mass m gives in proportion to (m0/m)^ZEAL times its cover."""
LIGHTEST = 0.25
"""[m0] Lighter ones give no more zealously than this."""
COVER_ONE = 2**24
"""Fixed point of cover: integers add up the same in any order."""


@ti.data_oriented
class Supply:
    """asked (p,), wanted by pores and by seepage in turn; granted to the pores first.

    cover (p,)  int64, COVER_ONE = wholly covered, by particles in front [0] and behind [1]
    claim (p,)  the same, each particle's part times its zeal
    """

    def __init__(self, build, water):
        state, sheet = build.state, build.scene.sheet
        self.water = water
        self.contact = build.parts["contact"]
        self.state_count = state.count
        self.x, self.v = state["fluid.x"], state["fluid.v"]
        self.mass, self.units = state["fluid.mass"], state["fluid.mass_units"]
        self.triangle, self.side = state["fluid.triangle"], state["fluid.side"]
        self.dx = build.config.fluid.spacing
        height = film_height(build.config, self.dx)
        self.full = water.liquid.rest_density * self.dx**3
        self.cover_per_mass = 1.0 / (height * water.liquid.rest_density * water.area)
        self.half = max(math.sqrt(self.dx**3 / height), water.spacing)
        self.uv = ti.Vector.field(2, float, shape=water.node_count)
        self.uv.from_numpy(sheet.uv.astype(np.float64 if self.mass.dtype == ti.f64 else np.float32))
        capacity = state.sizes["fluid"]
        self.place = ti.Vector.field(2, float, shape=capacity)
        self.face = ti.field(ti.i32, shape=capacity)
        self.cover = ti.Vector.field(2, ti.i64, shape=water.patch_count)
        self.claim = ti.Vector.field(2, ti.i64, shape=water.patch_count)
        self.for_pores = ti.Vector.field(2, ti.i64, shape=water.patch_count)
        self.for_film = ti.Vector.field(2, ti.i64, shape=water.patch_count)
        self.granted = ti.Vector.field(2, ti.i64, shape=water.patch_count)

    @ti.kernel
    def begin(self, dt: float):
        """Who touches where, on which face, and how much of each patch is covered."""
        ti.loop_config(serialize=self.water.few)
        for p in range(self.water.patch_count):
            for f in ti.static(range(2)):
                self.cover[p][f] = 0
                self.claim[p][f] = 0
                self.for_pores[p][f] = 0
                self.for_film[p][f] = 0
        for i in range(self.state_count[None]):
            self.face[i] = -1
            if self.side[i] != 0 and self.units[i] > 0:
                _, height, w = plane_gap(self.x[i], *self.contact.sheet.points(self.triangle[i]))
                if self.side[i] * height < TOUCH * self.dx and w.min() > -0.5:
                    self.face[i] = (1 - self.side[i]) // 2
                    corner = self.contact.sheet.corner[self.triangle[i]]
                    w = ti.max(w, 0.0) / ti.max(w, 0.0).sum()
                    place = w[0] * self.uv[corner[0]] + w[1] * self.uv[corner[1]] + w[2] * self.uv[corner[2]]
                    self.place[i] = place
                    self._cover(i)

    @ti.func
    def _cover(self, i):
        """Add the puddle of particle i to the patches under it."""
        covers, zeal, face = self._covers(i), self._zeal(i), self.face[i]
        i0, i1, j0, j1 = self._window(self.place[i])
        norm = self._norm(self.place[i], i0, i1, j0, j1)
        for a, b in ti.ndrange((i0, i1), (j0, j1)):
            p, share = a * self.water.columns + b, covers * self._tent(self.place[i], a, b) / norm
            ti.atomic_add(self.cover[p][face], ti.cast(share * COVER_ONE, ti.i64))
            ti.atomic_add(self.claim[p][face], ti.cast(zeal * share * COVER_ONE, ti.i64))

    @ti.func
    def _zeal(self, i):
        """How much more readily particle i gives than a full one."""
        return ti.max(self.mass[i] / self.full, LIGHTEST) ** -ZEAL

    @ti.func
    def _covers(self, i):
        """Patch areas that the puddle of particle i covers."""
        return self.mass[i] * self.cover_per_mass

    @ti.func
    def _window(self, place):
        """Patches whose centre lies within `half` of the place."""
        a = self.water.spacing
        low = ti.cast(ti.floor((place - self.half) / a - 0.5), ti.i32) + 1
        high = ti.cast(ti.ceil((place + self.half) / a - 0.5), ti.i32)
        return (
            ti.max(low[0], 0),
            ti.min(high[0], self.water.rows),
            ti.max(low[1], 0),
            ti.min(high[1], self.water.columns),
        )

    @ti.func
    def _tent(self, place, i, j):
        centre = (tm.vec2(ti.cast(i, float), ti.cast(j, float)) + 0.5) * self.water.spacing
        w = ti.max(1.0 - ti.abs(place - centre) / self.half, 0.0)
        return w[0] * w[1]

    @ti.func
    def _norm(self, place, i0, i1, j0, j1):
        total = 1e-12
        for a, b in ti.ndrange((i0, i1), (j0, j1)):
            total += self._tent(place, a, b)
        return total

    @ti.func
    def covered(self, p, face):
        """Fraction of patch p that water covers on a face, at most 1."""
        return ti.min(ti.cast(self.cover[p][face], float) / COVER_ONE, 1.0)

    @ti.kernel
    def transfer(self, dt: float):
        """Take from particles what patches ask, as far as each has it; book it, pores before film."""
        ti.loop_config(serialize=self.water.few)
        for p in range(self.water.patch_count):
            self.granted[p] = ti.Vector([0, 0], ti.i64)
        for i in range(self.state_count[None]):
            face = self.face[i]
            if face >= 0:
                self._give(i, face)
        ti.loop_config(serialize=self.water.few)
        for p in range(self.water.patch_count):
            for f in ti.static(range(2)):
                to_pores = ti.min(self.granted[p][f], self.for_pores[p][f])
                self.water.pores[p] += to_pores
                self.water.film[p] += self.granted[p][f] - to_pores

    @ti.func
    def _give(self, i, face):
        place = self.place[i]
        covers = self._covers(i) * self._zeal(i)
        i0, i1, j0, j1 = self._window(place)
        norm = self._norm(place, i0, i1, j0, j1)
        asked = ti.cast(0.0, ti.f64)
        for a, b in ti.ndrange((i0, i1), (j0, j1)):
            asked += self._asked(a * self.water.columns + b, face, covers * self._tent(place, a, b) / norm)
        if asked > 0.0:
            left = self.units[i]
            scale = ti.min(1.0, ti.cast(left, ti.f64) / asked)
            for a, b in ti.ndrange((i0, i1), (j0, j1)):
                p = a * self.water.columns + b
                share = self._asked(p, face, covers * self._tent(place, a, b) / norm)
                taken = ti.min(ti.cast(scale * share, ti.i64), left)
                left -= taken
                ti.atomic_add(self.granted[p][face], taken)
                self.water.carry(p, taken, self.v[i])
            self.units[i] = left
            self.mass[i] = ti.cast(ti.cast(left, ti.f64) * MASS_UNIT, float)

    @ti.func
    def _asked(self, p, face, share):
        """This particle's part of what patch p asks of a face, by its part of the claim."""
        part = ti.cast(0.0, ti.f64)
        if self.claim[p][face] > 0:
            whole = ti.cast(self.for_pores[p][face] + self.for_film[p][face], ti.f64)
            part = whole * ti.cast(share * COVER_ONE, ti.f64) / ti.cast(self.claim[p][face], ti.f64)
        return part
