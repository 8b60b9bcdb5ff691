"""Seep: pressure drives water through saturated cloth into a film on the far face."""

import math

import taichi as ti

from sim.model import Model
from sim.registry import register
from sim.stage import Build, Stage

OPENS = 0.95
"""[1] Saturation at which the first paths through the thickness are open; all are at 1."""
FILM_HANGS = 1e-5
"""[m] A film this thick has joined the menisci below: no threshold any more."""


@register("wetting", "seep")
@ti.data_oriented
class Seep:
    """Forchheimer flow, mu q / K + beta rho q^2 = G, G = dp/t + rho g cos(slope)   [Pa/m]

    q = (-mu/K + sqrt((mu/K)^2 + 4 beta rho G)) / (2 beta rho), beta = 0.143 phi^-1.5 K^-0.5 (Ergun 1952).
    Threshold until a film hangs below: break_through of a repellent cloth, else 2 gamma / l_c (menisci).
    A film fills the gap to a solid and no more: cloth that lies on a table lets nothing through.
    """

    class Params(Model):
        """None: the fabric card says it all."""

    rows = ("patch.pores", "patch.film", "cloth.pressure_front", "cloth.pressure_back")
    scratch = ()

    def __init__(self, build: Build, params: "Seep.Params"):
        self.water, self.supply = build.parts["cloth_water"], build.parts["supply"]
        fabric, liquid = build.config.cloth.fabric, build.config.fluid.liquid
        self.permeability = fabric.permeability_through
        self.thickness, self.rho, self.mu = fabric.thickness, liquid.rest_density, liquid.mu
        if self.permeability > 0.0:
            self.beta = 0.143 * fabric.porosity**-1.5 * self.permeability**-0.5
        self.repels = math.cos(fabric.contact_angle) <= 0.0
        self.threshold = threshold(fabric, liquid, self.water.gravity_size)

    def stages(self) -> tuple[Stage, ...]:
        """One: ask. A tight cloth asks for nothing."""
        if self.permeability == 0.0:
            return ()
        return (Stage("wetting.seep", "wet", self.ask, reads=("patch.pores", "patch.film")),)

    @ti.func
    def flow(self, gradient):
        """q [m/s] of a positive gradient G [Pa/m]."""
        linear = self.mu / self.permeability
        inertial = self.beta * self.rho
        return 2.0 * gradient / (linear + ti.sqrt(linear * linear + 4.0 * inertial * gradient))

    @ti.kernel
    def ask(self, dt: float):
        """Demand of the far side's film on the face that pushes."""
        ti.loop_config(serialize=self.water.few)
        for p in range(self.water.patch_count):
            s = self.water.saturation(p)
            opened = ti.math.clamp((s - OPENS) / (1.0 - OPENS), 0.0, 1.0)
            if ti.static(self.repels):
                opened = 1.0
            front, back = self.water.pressures(p)
            drive = front - back - self.rho * self.thickness * self.water.gravity.dot(self.water.normal[p])
            held_back = self.threshold
            if self.water.film_thickness(p) > FILM_HANGS:
                held_back = 0.0
            if ti.abs(drive) > held_back and opened > 0.0:
                face = 0 if drive > 0.0 else 1
                q = opened * self.flow(ti.abs(drive) / self.thickness)
                volume = self.supply.covered(p, face) * q * self.water.area * dt
                film = self.water.film_thickness(p)
                fits = self.water.gap(p, 1 - face, 2.0 * (film + volume / self.water.area)) - film
                self.supply.for_film[p][face] = self.water.units(ti.min(volume, ti.max(fits, 0.0) * self.water.area))


def threshold(fabric, liquid, gravity: float) -> float:
    """Pressure that opens a dry underside [Pa]: the card's break_through, or from contact angle and menisci."""
    if fabric.break_through is not None and fabric.break_through > 0.0:
        return fabric.break_through
    if math.cos(fabric.contact_angle) <= 0.0:
        return fabric.threshold(liquid.surface_tension)
    if gravity == 0.0 or liquid.surface_tension == 0.0:
        return 0.0
    capillary_length = math.sqrt(liquid.surface_tension / (liquid.rest_density * gravity))
    return 2.0 * liquid.surface_tension / capillary_length
