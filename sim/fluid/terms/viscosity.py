"""Viscosity."""

import taichi as ti

from sim.registry import register
from sim.schema import Model
from sim.stage import Build, Limit


@register("fluid.term", "viscosity")
@ti.data_oriented
class Viscosity:
    """a_i = sum_j m_j 2 nu/rho0 (r . grad W)/(r^2 + 0.01 h^2) (v_i - v_j),  h = H/2.   Morris 1997, eq. 22

    Densities are rho0, so a pair's forces are opposite to rounding, and a ragged surface is no thicker than the bulk.
    """

    class Params(Model):
        """None: nu is the liquid's."""

    rows = ("fluid.x", "fluid.v")
    scratch = ()

    def __init__(self, build: Build, params: Params):
        fluid = build.config.fluid
        self.x, self.v = build.state["fluid.x"], build.state["fluid.v"]
        self.nu = fluid.liquid.nu
        self.factor = 2.0 * fluid.liquid.nu / fluid.liquid.rest_density
        self.h = 0.5 * fluid.support_radius

    @ti.func
    def acceleration(self, i, j, r, gradient):
        """Of particle i by j [m/s^2]; r = x_i - x_j, gradient = m_j grad_i W_ij."""
        return self.factor * r.dot(gradient) / (r.norm_sqr() + 0.01 * self.h * self.h) * (self.v[i] - self.v[j])

    def limit(self) -> Limit:
        """dt <= 0.125 h^2/nu.   Morris 1997"""
        return Limit(0.125 * self.h**2 / self.nu if self.nu else float("inf"), "viscosity")
