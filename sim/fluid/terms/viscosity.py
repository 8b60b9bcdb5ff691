"""Viscosity."""

import numpy as np
import taichi as ti

from sim.fluid.terms.wall_viscosity import WallViscosity
from sim.maths.kernels import KERNELS, SmoothingKernel, lattice_points, lattice_shares
from sim.registry import register
from sim.schema import Model
from sim.stage import Build, Limit

SOFTENING = 0.01
"""Of h^2, added to r^2: two particles in one place pull with no force."""


def lattice_factor(kernel: SmoothingKernel, support: float) -> float:
    """What the sum below makes of nu on the cubic lattice: 0.943 at support 2, 0.987 at 3 (Wendland C2)."""
    r = np.array([p for p in lattice_points(support) if any(p)], float)
    sq = (r * r).sum(1)
    slope = np.array([kernel.slope(d, support) for d in np.sqrt(sq)]) / lattice_shares(kernel, support)[0]
    return float(-(slope * sq / (sq + SOFTENING * 0.25 * support**2) * r[:, 2] ** 2).sum())


@register("fluid.term", "viscosity")
@ti.data_oriented
class Viscosity:
    """a_i = sum_j m_j 2 nu/rho0 (r . grad W)/(r^2 + 0.01 h^2) (v_i - v_j),  h = H/2.   Morris 1997, eq. 22

    Divided by what that makes of nu on the lattice. Solids with no_slip drag as well: see WallViscosity.
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
        nu = fluid.liquid.nu / lattice_factor(KERNELS[fluid.kernel], fluid.support)
        self.factor = 2.0 * nu / fluid.liquid.rest_density
        self.h = 0.5 * fluid.support_radius
        self.walls = WallViscosity(build, fluid.liquid.nu)
        self.at_walls = self.walls.some

    @ti.func
    def acceleration(self, i, j, r, gradient):
        """Of particle i by j [m/s^2]; r = x_i - x_j, gradient = m_j grad_i W_ij."""
        return self.factor * r.dot(gradient) / (r.norm_sqr() + SOFTENING * self.h * self.h) * (self.v[i] - self.v[j])

    @ti.func
    def wall_acceleration(self, i):
        """Of particle i by the solids [m/s^2]."""
        return self.walls.acceleration(i)

    def limit(self) -> Limit:
        """dt <= 0.125 h^2/nu.   Morris 1997"""
        return Limit(0.125 * self.h**2 / self.nu if self.nu else float("inf"), "viscosity")
