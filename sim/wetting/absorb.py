"""Absorb: water that touches the sheet fills its pores."""

import taichi as ti

from sim.model import Model
from sim.registry import register
from sim.stage import Build, Stage


@register("wetting", "absorb")
@ti.data_oriented
class Absorb:
    """Darcy through half the thickness, q = (K/mu) (p + p_c0 (1 - S)) / (t/2), solved exactly over the step:

    S <- min(1, S_inf - (S_inf - S) exp(-dt/tau)), S_inf = 1 + p/p_c0, tau = phi t^2 mu / (2 K p_c0)
    (1.6 ms for cotton: an explicit step overshoots). Only the covered part of a patch drinks.
    """

    class Params(Model):
        """None: the fabric card says it all."""

    rows = ("patch.pores", "cloth.pressure_front", "cloth.pressure_back")
    scratch = ()

    def __init__(self, build: Build, params: "Absorb.Params"):
        self.water, self.supply = build.parts["cloth_water"], build.parts["supply"]
        fabric, liquid = build.config.cloth.fabric, build.config.fluid.liquid
        through = max(fabric.permeability_through, 1e-30)
        self.suction = self.water.suction
        self.drinks = self.suction > 0.0 and fabric.permeability_through > 0.0
        self.tau = fabric.porosity * fabric.thickness**2 * liquid.mu / (2.0 * through * max(self.suction, 1e-9))

    def stages(self) -> tuple[Stage, ...]:
        """One: ask. A repellent or tight cloth asks for nothing."""
        if not self.drinks:
            return ()
        return (Stage("wetting.absorb", "wet", self.ask, reads=("patch.pores",)),)

    @ti.kernel
    def ask(self, dt: float):
        """Demand of the pores on each face, by cover."""
        fill = 1.0 - ti.exp(-dt / self.tau)
        ti.loop_config(serialize=self.water.few)
        for p in range(self.water.patch_count):
            front, back = self.water.pressures(p)
            s = self.water.saturation(p)
            pressure, wanted = ti.Vector([front, back]), ti.Vector([0.0, 0.0])
            for f in ti.static(range(2)):
                s_inf = 1.0 + pressure[f] / self.suction
                wanted[f] = self.supply.covered(p, f) * ti.max((s_inf - s) * fill, 0.0)
            wanted *= ti.min(1.0, (1.0 - s) / ti.max(wanted.sum(), 1e-12))
            for f in ti.static(range(2)):
                self.supply.for_pores[p][f] = ti.cast(wanted[f] * self.water.capacity_real, ti.i64)
