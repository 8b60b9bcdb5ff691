"""The film under the sheet: it creeps downhill, and where it is thick it gathers into pendant drops."""

import math

import numpy as np
import taichi as ti

from sim.wetting.faces import Faces

RIPPLE = 12.0
"""[1] In the growth rate of the fastest ripple of a hanging film, (rho g)^2 h^3 / (12 mu gamma)."""


@ti.data_oriented
class Film:
    """Lubrication flow q = rho g_along h^3 / (3 mu) per width, and growth of the fastest Rayleigh-Taylor ripple.

    Ripples are 2 pi sqrt(2) l_c apart (24 mm for water), so drops hang at `sites`, a lattice of that width with
    points on all hems; film thicker than `thickest` goes to the site of its neighbourhood at the ripple's rate
    (Fermigier et al. 1992). A hem's own film, having nowhere to creep, gathers with all of gravity. No drop hangs, and
    nothing gathers, where a solid is nearer than `room` [m] to where it would hang, `spacing` below the patch. Whoever
    makes a Film knows how large its drops are, and sets `room`.
    """

    def __init__(self, water, thickest: float, spacing: float, down):
        self.water, self.spacing, self.down, self.room = water, spacing, down, 0.0
        self.rho, self.mu = water.liquid.rest_density, water.liquid.mu
        self.gamma = max(water.liquid.surface_tension, 1e-6)
        self.thickest = thickest
        self.capillary_length = math.sqrt(self.gamma / (self.rho * max(water.gravity_size, 1e-9)))
        site_of, sites = lay_sites(water, 2.0 * math.pi * math.sqrt(2.0) * self.capillary_length)
        self.sites = _int_field(sites)
        self.site_of = _int_field(site_of)
        self.free = ti.field(ti.i32, shape=water.patch_count)
        self.faces = Faces(water)

    @ti.kernel
    def flow(self, dt: float):
        """Creep through faces, then gather; film and momentum move together. free[p]: a drop of site p hangs clear."""
        ti.loop_config(serialize=True)
        for k in range(self.sites.shape[0]):
            p = self.sites[k]
            self.free[p] = ti.cast(self.water.open_at(self.below(p), self.room), ti.i32)
        ti.loop_config(serialize=self.water.few)
        for i, j in ti.ndrange(self.water.rows, self.water.columns):
            self.faces.ask(self, i, j, dt)
        ti.loop_config(serialize=self.water.few)
        for i, j in ti.ndrange(self.water.rows, self.water.columns):
            self.faces.take(self.water.film, i, j)
        ti.loop_config(serialize=self.water.few)
        for p in range(self.water.patch_count):
            site = self.site_of[p]
            if site != p:
                self._gather(p, site, dt)

    @ti.func
    def below(self, p):
        """Where a drop hangs from patch p [m]."""
        return self.water.centre(p) + self.spacing * self.down

    @ti.func
    def through(self, p, q, dt):
        """Mass units that creep from patch p to q in this step; never more than an eighth of what is there."""
        r = self.water.centre(q) - self.water.centre(p)
        pull = self.water.gravity.dot(r) / ti.max(r.norm(), 1e-9)
        source = p
        if pull < 0.0:
            source = q
        moved = ti.cast(0, ti.i64)
        if self.site_of[source] != source:
            h = self.water.film_thickness(source)
            volume = self.rho * pull * h**3 / (3.0 * self.mu) * self.water.spacing * dt
            most = self.water.film[source] // 8
            moved = ti.max(ti.min(self.water.units(volume), most), -most)
        return moved

    @ti.func
    def _gather(self, p, site, dt):
        h = self.water.film_thickness(p)
        if h > self.thickest and self.free[site] == 1:
            i, j = p // self.water.columns, p % self.water.columns
            across = ti.abs(self.water.gravity.dot(self.water.normal[p]))
            if i == 0 or j == 0 or i == self.water.rows - 1 or j == self.water.columns - 1:
                across = self.water.gravity_size
            rate = (self.rho * across) ** 2 * h**3 / (RIPPLE * self.mu * self.gamma)
            volume = (h - self.thickest) * (1.0 - ti.exp(-rate * dt)) * self.water.area
            units = ti.min(self.water.units(volume), self.water.film[p] // 2)
            self.water.film[p] -= units
            self.water.carry(p, -units, self.water.velocity[p])
            ti.atomic_add(self.water.film[site], units)
            self.water.carry(site, units, self.water.velocity[p])


def lay_sites(water, width: float) -> tuple[np.ndarray, np.ndarray]:
    """(site of each patch (p,), the sites (s,)), as patches: a square lattice `width` [m] apart, hems included."""

    def stops(patches: int) -> np.ndarray:
        count = max(2, round((patches - 1) * water.spacing / width) + 1) if patches > 1 else 1
        return np.unique(np.round(np.linspace(0, patches - 1, count)).astype(int))

    rows, columns = stops(water.rows), stops(water.columns)
    nearest_row = rows[np.abs(np.arange(water.rows)[:, None] - rows).argmin(1)]
    nearest_column = columns[np.abs(np.arange(water.columns)[:, None] - columns).argmin(1)]
    site_of = (nearest_row[:, None] * water.columns + nearest_column).ravel()
    return site_of, np.unique(site_of)


def _int_field(values: np.ndarray):
    field = ti.field(ti.i32, shape=len(values))
    field.from_numpy(np.asarray(values, np.int32))
    return field
