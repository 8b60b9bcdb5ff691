"""Drip: pendant drops that have grown enough fall as new particles."""

import math

import numpy as np
import taichi as ti
import taichi.math as tm

from sim.constants import MASS_UNIT
from sim.model import Model, quantity
from sim.registry import register
from sim.stage import Build, Stage
from sim.wetting.film import Film

TATE = 0.6
"""[1] Part of 2 pi R gamma that falls, the rest stays at the neck (Harkins & Brown 1919)."""
CLEAR = 0.9
"""[dx] A new particle waits until no other is nearer: closer would burst apart."""
BLOCKED = -1
JET_MAX = 1.0
"""[m/s] A site that is fed faster than drops can fall away lets a jet go, at most this fast."""


@register("wetting", "drip")
@ti.data_oriented
class Drip:
    """A drop of V = 0.6 x 2 pi R gamma / (rho g) leaves its site as max(1, round(V/dx^3)) equal particles.

    Tate 1864, Harkins & Brown 1919; R = l_c, the capillary length, unless the weave sets it. They start at the cloth's
    velocity, at least dx below it and clear of others and of solids, else the site waits. n waiting drops speed up what
    leaves by (n - 1) sqrt(g dx / 2), so that a site never chokes.
    """

    class Params(Model):
        """[wetting.drip]"""

        drop_radius: float | None = quantity(None, "length", gt=0, why="R of Tate's law; absent = the capillary length")
        film_thickest: float = quantity("0.15 mm", "length", gt=0, why="thicker film gathers into drops")

    rows = ("patch.film", "fluid.x", "fluid.v", "fluid.mass_units", "cloth.x", "cloth.v")
    scratch = ()
    conserves = ("momentum",)

    def __init__(self, build: Build, params: "Drip.Params"):
        self.water, self.population = build.parts["cloth_water"], build.parts["population"]
        self.dx = build.config.fluid.spacing
        self.down = tm.vec3(*(g / max(self.water.gravity_size, 1e-9) for g in build.config.space.gravity))
        self.film = Film(self.water, params.film_thickest, self.dx, self.down)
        self.state_count, self.x = build.state.count, build.state["fluid.x"]
        radius = params.drop_radius or self.film.capillary_length
        volume = TATE * 2.0 * math.pi * radius * self.film.gamma / (self.film.rho * max(self.water.gravity_size, 1e-9))
        self.particles = max(1, round(volume / self.dx**3))
        self.particle_units = round(self.film.rho * volume / self.particles / MASS_UNIT)
        self.drop_units = self.particles * self.particle_units
        offsets = drop_lattice(self.particles, self.dx)
        self.offset = ti.Vector.field(3, float, shape=self.particles)
        self.offset.from_numpy(offsets.astype(np.float64 if self.x.dtype == ti.f64 else np.float32))
        lump = float(np.linalg.norm(offsets, axis=1).max())
        self.reach = lump + CLEAR * self.dx
        self.film.room = lump + 0.5 * self.dx
        sites = self.film.sites.shape[0]
        self.ready = ti.field(ti.i32, shape=sites)
        self.ready_count, self.drops = ti.field(ti.i32, shape=()), ti.field(ti.i32, shape=())

    def stages(self) -> tuple[Stage, ...]:
        """The film moves, then drops fall."""
        writes = ("patch.film", "fluid.x", "fluid.v", "fluid.mass_units")
        return (
            Stage("wetting.film", "wet", self.film.flow, reads=("patch.film", "cloth.x"), writes=("patch.film",)),
            Stage("wetting.drip", "wet", self.release, reads=("patch.film", "fluid.x"), writes=writes),
        )

    @ti.kernel
    def release(self, dt: float):
        """List sites with a drop to give, drop those that are not clear, let the others go in order."""
        found = 0
        ti.loop_config(serialize=True)
        for k in range(self.film.sites.shape[0]):
            p = self.film.sites[k]
            if self.water.film[p] >= ti.i64(self.drop_units) and self.film.free[p] == 1:
                self.ready[found] = p
                found += 1
        self.ready_count[None] = found
        if found > 0:
            for i in range(self.state_count[None]):
                for k in range(self.ready_count[None]):
                    p = self.ready[k]
                    if p >= 0 and self._too_near(i, p):
                        self.ready[k] = BLOCKED
            ti.loop_config(serialize=True)
            for k in range(self.ready_count[None]):
                if self.ready[k] >= 0:
                    self._let_go(self.ready[k])

    @ti.func
    def _too_near(self, i, p):
        near = False
        r = self.x[i] - self.film.below(p)
        if r.norm() < self.reach:
            for d in range(self.particles):
                near = near or (r - self.offset[d]).norm() < CLEAR * self.dx
        return near

    @ti.func
    def _let_go(self, p):
        waiting = ti.cast(self.water.film[p] // ti.i64(self.drop_units), float)
        jet = ti.min((waiting - 1.0) * ti.sqrt(0.5 * self.water.gravity_size * self.dx), JET_MAX)
        v = self.water.velocity[p] + jet * self.down
        fits = self.state_count[None] + self.particles <= self.population.capacity
        if fits:
            for d in range(self.particles):
                self.population.append(self.film.below(p) + self.offset[d], v, ti.i64(self.particle_units))
            self.water.film[p] -= ti.i64(self.drop_units)
            self.water.carry(p, -ti.i64(self.drop_units), v)
            self.drops[None] += 1
        else:
            self.population.refused[0] += 1


def drop_lattice(count: int, dx: float) -> np.ndarray:
    """(count, 3) places dx apart, a compact lump (nearest cubic lattice points to a centre) with its top at z <= 0."""
    reach = int(np.ceil(count ** (1 / 3))) + 1
    axis = np.arange(-reach, reach + 1)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3).astype(float)
    order = np.lexsort((points[:, 0], points[:, 1], points[:, 2], np.round((points**2).sum(1), 6)))
    lump = points[order[:count]] * dx
    lump -= lump.mean(0)
    lump[:, 2] -= lump[:, 2].max()
    return lump
