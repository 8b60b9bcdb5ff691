"""Water held by the sheet: integer mass in pores and film a patch, its momentum, its weight on the nodes.

Whatever a process moves, it moves whole mass units and their momentum (int64 as well, so that sums do not depend on
the order of threads); `settle` then gives each node its quarter of the patches around it.
"""

import math

import numpy as np
import taichi as ti
import taichi.math as tm

from sim import runtime
from sim.constants import MASS_UNIT

SMOOTHING = 0.03
"""[s] Contact impulses come in bursts; the pressure that drives seepage is their mean over this time."""


@ti.data_oriented
class ClothWater:
    """Patches of the sheet as holders of water. p = i * columns + j for the quad of nodes (i, j) .. (i+1, j+1).

    capacity           mass units that the pores of a patch hold, rho phi t a^2
    normal, velocity   of a patch now; set by `begin`
    front, back        smoothed contact pressure of water on a node's two faces [Pa] (saved)
    momentum (p,)      int64 vector [MASS_UNIT m/s] that this step's exchanges have brought to the patch
    """

    def __init__(self, build):
        config, sheet, state = build.config, build.scene.sheet, build.state
        self.liquid, self.fabric = config.fluid.liquid, config.cloth.fabric
        self.walls = build.parts["walls"]
        self.gravity = tm.vec3(*config.space.gravity)
        self.gravity_size = math.sqrt(sum(g * g for g in config.space.gravity))
        self.rows, self.columns = sheet.shape[0] - 1, sheet.shape[1] - 1
        self.nodes_across = sheet.shape[1]
        self.spacing = sheet.spacing
        self.area = sheet.spacing**2
        self.patch_count, self.node_count = len(sheet.patches), len(sheet.x)
        volume = self.fabric.porosity * self.fabric.thickness * self.area
        self.few = runtime.few(8 * self.node_count)
        self.capacity = round(self.liquid.rest_density * volume / MASS_UNIT)
        self.capacity_real = float(self.capacity)
        self.suction = self.fabric.capillary(self.liquid.surface_tension)
        if self.fabric.capillary_pressure is not None:
            self.suction = self.fabric.capillary_pressure
        self.x, self.v = state["cloth.x"], state["cloth.v"]
        self.mass, self.inv_mass = state["cloth.mass"], state["cloth.inv_mass"]
        self.pores, self.film = state["patch.pores"], state["patch.film"]
        self.push_front, self.push_back = state["cloth.push_front"], state["cloth.push_back"]
        self.front, self.back = state["cloth.pressure_front"], state["cloth.pressure_back"]
        self.dry = _real_field(sheet.mass)
        self.pinned = ti.field(ti.i32, shape=self.node_count)
        self.pinned.from_numpy((np.asarray(sheet.inv_mass) == 0.0).astype(np.int32))
        self.node_area = _real_field(sheet.mass / self.fabric.area_density)
        self.normal = ti.Vector.field(3, float, shape=self.patch_count)
        self.velocity = ti.Vector.field(3, float, shape=self.patch_count)
        self.momentum = ti.Vector.field(3, ti.i64, shape=self.patch_count)

    @ti.kernel
    def begin(self, dt: float):
        """Smooth the pressures; normals and velocities of patches; no momentum exchanged yet."""
        keep = ti.exp(-dt / SMOOTHING)
        ti.loop_config(serialize=self.few)
        for n in range(self.node_count):
            area = dt * self.node_area[n]
            self.front[n] = keep * self.front[n] + (1.0 - keep) * self.push_front[n] / area
            self.back[n] = keep * self.back[n] + (1.0 - keep) * self.push_back[n] / area
        ti.loop_config(serialize=self.few)
        for p in range(self.patch_count):
            a, b, c, d = self.corners(p)
            self.normal[p] = (self.x[c] - self.x[a]).cross(self.x[d] - self.x[b]).normalized(1e-30)
            self.velocity[p] = 0.25 * (self.v[a] + self.v[b] + self.v[c] + self.v[d])
            self.momentum[p] = ti.Vector([0, 0, 0], ti.i64)

    @ti.kernel
    def settle(self, dt: float):
        """m_new v_new = m v + momentum brought; pinned nodes hand theirs to the clip."""
        ti.loop_config(serialize=self.few)
        for n in range(self.node_count):
            i, j = n // self.nodes_across, n % self.nodes_across
            brought = ti.Vector([0.0, 0.0, 0.0], ti.f64)
            water = ti.cast(0, ti.i64)
            for di, dj in ti.static(((-1, -1), (-1, 0), (0, -1), (0, 0))):
                if 0 <= i + di < self.rows and 0 <= j + dj < self.columns:
                    p = (i + di) * self.columns + j + dj
                    brought += ti.cast(self.momentum[p], ti.f64)
                    water += self.pores[p] + self.film[p]
            mass = self.dry[n] + ti.cast(0.25 * MASS_UNIT * ti.cast(water, ti.f64), float)
            if not self.pinned[n]:
                gained = ti.cast(0.25 * MASS_UNIT * brought, float)
                self.v[n] = (self.mass[n] * self.v[n] + gained) / mass
                self.inv_mass[n] = 1.0 / mass
            self.mass[n] = mass

    @ti.func
    def corners(self, p):
        """Nodes of patch p, round it."""
        a = (p // self.columns) * self.nodes_across + p % self.columns
        return a, a + self.nodes_across, a + self.nodes_across + 1, a + 1

    @ti.func
    def saturation(self, p):
        """Pore water over pore volume."""
        return ti.cast(ti.cast(self.pores[p], ti.f64) / self.capacity_real, float)

    @ti.func
    def room(self, p):
        """Mass units that the pores of a patch still take."""
        return ti.i64(self.capacity) - self.pores[p]

    @ti.func
    def film_thickness(self, p):
        """Film mass over rho a^2 [m]."""
        return ti.cast(ti.cast(self.film[p], ti.f64) * (MASS_UNIT / (self.liquid.rest_density * self.area)), float)

    @ti.func
    def pressures(self, p):
        """(front, back) of a patch: mean of its nodes [Pa]."""
        a, b, c, d = self.corners(p)
        front = 0.25 * (self.front[a] + self.front[b] + self.front[c] + self.front[d])
        back = 0.25 * (self.back[a] + self.back[b] + self.back[c] + self.back[d])
        return front, back

    @ti.func
    def centre(self, p):
        """Middle of a patch now [m]."""
        a, b, c, d = self.corners(p)
        return 0.25 * (self.x[a] + self.x[b] + self.x[c] + self.x[d])

    @ti.func
    def gap(self, p, face, reach):
        """From a face of patch p to the solid on that side [m], 0 where it rests there; if it is nearer than reach."""
        x, half = self.centre(p), 0.5 * self.fabric.thickness
        outwards, least = self.normal[p] * (1.0 if face == 0 else -1.0), reach
        for s in range(self.walls.count):
            if self.walls.nearer(s, x, least + half):
                nd = self.walls.distance(s, x)
                if nd.xyz.dot(outwards) < 0.0:
                    least = ti.min(least, ti.max(nd[3] - half, 0.0))
        return least

    @ti.func
    def open_at(self, x, reach):
        """Whether no solid is nearer to x than reach [m]."""
        found = True
        for s in range(self.walls.count):
            if self.walls.nearer(s, x, reach):
                found = found and self.walls.distance(s, x)[3] >= reach
        return found

    @ti.func
    def units(self, volume):
        """Volume [m^3] of this liquid in whole mass units, rounded."""
        return ti.cast(ti.round(ti.cast(volume, ti.f64) * (self.liquid.rest_density / MASS_UNIT)), ti.i64)

    @ti.func
    def carry(self, p, units, v):
        """Book momentum units * v for patch p; an atomic integer sum, the same in any order."""
        for k in ti.static(range(3)):
            ti.atomic_add(self.momentum[p][k], momentum_of(units, v[k]))

    def totals(self) -> tuple[int, int]:
        """(held in pores, film) of the whole sheet in mass units."""
        return int(self.pores.to_numpy().sum()), int(self.film.to_numpy().sum())

    def on_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """(saturation, film thickness [m]) a node, f32: the mean of the patches around it."""
        film_unit = MASS_UNIT / (self.liquid.rest_density * self.area)
        shape = (self.rows, self.columns)
        saturation = self.pores.to_numpy().reshape(shape) / self.capacity
        film = self.film.to_numpy().reshape(shape) * film_unit
        return tuple(_node_mean(values).astype(np.float32).ravel() for values in (saturation, film))


@ti.func
def momentum_of(units, speed):
    """Mass units times speed, rounded to a whole."""
    return ti.cast(ti.round(ti.cast(units, ti.f64) * ti.cast(speed, ti.f64)), ti.i64)


def _node_mean(patches: np.ndarray) -> np.ndarray:
    padded = np.pad(patches, 1, mode="edge")
    return 0.25 * (padded[:-1, :-1] + padded[1:, :-1] + padded[:-1, 1:] + padded[1:, 1:])


def _real_field(values: np.ndarray):
    field = ti.field(float, shape=len(values))
    field.from_numpy(values.astype(np.float64 if field.dtype == ti.f64 else np.float32))
    return field
