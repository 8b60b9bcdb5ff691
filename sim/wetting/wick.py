"""Wick: suction and gravity move pore water along the sheet."""

import taichi as ti

from sim.model import Model
from sim.registry import register
from sim.stage import Build, Limit, Stage
from sim.wetting.faces import Faces


@register("wetting", "wick")
@ti.data_oriented
class Wick:
    """Richards 1931 on the sheet's own mesh: q = (K_par k_r / mu) (-grad p_l + rho g_along), p_l = -p_c0 (1 - S).

    k_r = S, its arithmetic mean at faces (the upwind value gives a front that goes as t^0.47). Explicit:
    dt < a^2 / (4 D), D = K_par p_c0 / (phi mu).
    """

    class Params(Model):
        """None: the fabric card says it all."""

    rows = ("patch.pores", "cloth.x")
    scratch = ()

    def __init__(self, build: Build, params: "Wick.Params"):
        self.water = build.parts["cloth_water"]
        fabric, liquid = build.config.cloth.fabric, build.config.fluid.liquid
        self.suction = max(self.water.suction, 0.0)
        self.mobility = fabric.permeability_along / liquid.mu
        self.rho = liquid.rest_density
        self.section = self.water.spacing * fabric.thickness
        self.diffusivity = self.mobility * self.suction / fabric.porosity
        self.faces = Faces(self.water)

    def stages(self) -> tuple[Stage, ...]:
        """One: flow through faces, then add up. A cloth that does not conduct has none."""
        if self.mobility == 0.0:
            return ()
        reads = ("patch.pores", "cloth.x")
        return (Stage("wetting.wick", "wet", self.flow, reads=reads, writes=("patch.pores",), limit=self.max_dt),)

    def max_dt(self) -> Limit:
        """Stability of the explicit step, with a fifth to spare."""
        seconds = 0.2 * self.water.spacing**2 / self.diffusivity if self.diffusivity else float("inf")
        return Limit(seconds, "wicking")

    @ti.kernel
    def flow(self, dt: float):
        """Whole mass units through each face from (i, j) to its next along i [0] and j [1]; then the sums."""
        ti.loop_config(serialize=self.water.few)
        for i, j in ti.ndrange(self.water.rows, self.water.columns):
            self.faces.ask(self, i, j, dt)
        ti.loop_config(serialize=self.water.few)
        for i, j in ti.ndrange(self.water.rows, self.water.columns):
            self.faces.take(self.water.pores, i, j)

    @ti.func
    def through(self, p, q, dt):
        """Mass units from patch p to q in this step; never more than a quarter of what is there or fits."""
        s_p, s_q = self.water.saturation(p), self.water.saturation(q)
        r = self.water.centre(q) - self.water.centre(p)
        length = ti.max(r.norm(), 1e-9)
        drive = self.suction * (s_p - s_q) / self.water.spacing + self.rho * self.water.gravity.dot(r) / length
        volume = self.mobility * 0.5 * (s_p + s_q) * drive * self.section * dt
        moved = self.water.units(volume)
        room = ti.min(self.water.pores[p], self.water.room(q)) // 4
        back = ti.min(self.water.pores[q], self.water.room(p)) // 4
        return ti.max(ti.min(moved, ti.max(room, 0)), -ti.max(back, 0))
