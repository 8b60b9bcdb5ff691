"""Surface tension: a stress along the surface, as thick as a kernel, that pulls particles by pairs."""

import math

import numpy as np
import taichi as ti

from sim.maths.kernels import poly6_wall
from sim.registry import register
from sim.schema import Model, quantity
from sim.stage import Build, Limit, Stage
from sim.state import Row

HOLD = 3.0
"""[gamma/H] Pull of water on water beside the stress, which alone has no hold on a particle that strays: under 1.5 a
drop's surface boils, at 5 the liquid freezes into a lattice that rings faster than a liquid would. The outermost
particles sink in until their half of a neighbourhood is as dense as a whole one, a crust of 1.5 layers, and more order
lies under it: FILM."""
HOLD_SHARE = 63.0 / 512.0
"""[1] Tension of a pull of gamma/H over gamma: its planar moment, pi H^-1 int_0^H r^3 W dr."""
FILM = (2.5, 3.0), (0.96, 1.04)
"""[dx], [1] Supports, and the share of gamma that a flat film, settled into its layers, would pull with by the planar
moment alone: means over seven films each, stirred anew, which differ by 0.04. The stress is divided by it."""
FAINT, PLAIN = 0.1, 0.9
"""[1/H] Gradients of colour below the first are disorder of the bulk and pull nothing; from the second on, which the
outermost layer of a flat face reaches, a particle is surface and pulls no harder. Round a drop of 8 spacings' radius
that layer's gradient is a seventh steeper than on a flat face, as more of its neighbours lie below it: a stress that
grew with it pulled small drops too hard, and Laplace's pressure rose with 1/R by 18 % too much."""


@register("fluid.term", "surface_tension")
@ti.data_oriented
class SurfaceTension:
    """a_i = sum_j m_j/rho0^2 (T_i + T_j + 2 hold) grad W_ij,  T = gamma' s(|g|) (1 - n n),  n = g/|g|.   Lafaurie 1994

    g = grad of the colour sum_j m_j/rho0 W_ij, solids counted as water: no tension along them. Adhesion is what wets
    them or not, a_i = A/rho0 grad lambda/int lambda dd, lambda the share of W that solids fill: A [N/m] of an area
    wetted, by Young (1805) gamma cos(theta), and what the hold lacks there. A drop of 9 spacings' radius comes to 65
    deg where 60 are asked for, to 97 where 90 are; from 105 on, weightless, it lets go.
    s H = t^2 (3 - 2 t) rises from 0 at |g| = FAINT to 1 at PLAIN; gamma' so that a flat surface, stress and hold
    together, pulls with the liquid's gamma.
    W = 315/(64 pi H^3) (1 - r^2/H^2)^3 (Mueller 2003, poly6), broader than the kernel that pressure answers with:
    equal ones tear the surface into strings. Pairs' forces are opposite to rounding. Needs a support of 2.5 dx: at 2
    the lattice outweighs the tension. Pairwise cohesion (Akinci 2013) in its place, calibrated by its planar moment,
    rang 10 to 40 % too fast, with the pressure solve's tolerance, and its Laplace pressure drowned in its own.
    """

    class Params(Model):
        contact_angle: float = quantity(
            "90 deg", ge=0, le=math.pi, why="on every solid; 90: they neither draw nor shun"
        )

    rows = ("fluid.x", "fluid.mass")
    scratch = (
        Row("fluid.surface_tension.pull", "v", "1/m", "s(|g|) g/|g|", saved=False),
        Row("fluid.surface_tension.cling", "v", "m/s^2", "adhesion", saved=False),
    )

    def __init__(self, build: Build, params: Params):
        fluid = build.config.fluid
        self.state, self.pairs, self.walls = build.state, build.parts["pairs"], build.parts["walls"]
        self.x, self.mass = build.state["fluid.x"], build.state["fluid.mass"]
        self.pull, self.cling = (build.state[row.name] for row in self.scratch)
        self.tension, self.rest_density = fluid.liquid.surface_tension, fluid.liquid.rest_density
        self.support_radius, self.h = fluid.support_radius, 0.5 * fluid.support_radius
        self.faint, self.plain = FAINT / fluid.support_radius, PLAIN / fluid.support_radius
        self.inverse_sq = 1.0 / fluid.support_radius**2
        self.slope = -315.0 * 6.0 / (64.0 * math.pi * fluid.support_radius**5)
        bare = self.tension / np.interp(fluid.support, *FILM)
        self.stress = bare * (1.0 - HOLD * HOLD_SHARE) / _planar_moment() / self.rest_density**2
        self.hold = 2.0 * HOLD * self.tension / fluid.support_radius / self.rest_density**2
        self.adhesion = self.adhesive(params.contact_angle)
        self.at_walls = self.walls.count > 0

    def adhesive(self, angle: float) -> float:
        """A/(rho0 int lambda dd) [m^2/s^2] of a contact angle [rad]; the integral is that of the planar moment."""
        adhesion = self.tension * (math.cos(angle) + HOLD * HOLD_SHARE)
        return adhesion / (self.rest_density * HOLD_SHARE * self.support_radius)

    def stages(self) -> tuple[Stage, ...]:
        """surface (prepare)."""
        return (Stage("surface", "prepare", self.prepare, self.rows, ()),)

    def prepare(self, dt: float) -> None:
        """Where the surface is, and which way it faces."""
        self._face(self.adhesion, self.pairs.neighbour, self.pairs.slope)

    @ti.func
    def _slope(self, r, gradient):
        """grad W = slope r; none for a pair that is cut (see sim.fluid.pairs)."""
        u = ti.max(1.0 - r.norm_sqr() * self.inverse_sq, 0.0)
        return ti.select(gradient.norm_sqr() > 0.0, self.slope * u * u, 0.0)

    @ti.kernel
    def _face(self, adhesion: float, neighbour: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            x, g = self.x[i], self._solid(self.x[i])
            self.cling[i] = adhesion * g
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                j = neighbour[k]
                r = self.pairs.apart(x, j)
                g += self.mass[j] / self.rest_density * self._slope(r, slope[k] * r) * r
            size = g.norm()
            t = ti.min(ti.max((size - self.faint) / (self.plain - self.faint), 0.0), 1.0)
            self.pull[i] = t * t * (3.0 - 2.0 * t) / (self.support_radius * ti.max(size, 1e-12)) * g

    @ti.func
    def acceleration(self, i, j, r, gradient):
        """Of particle i by j [m/s^2]; r = x_i - x_j, gradient = m_j grad_i W_ij."""
        a, b = self.pull[i], self.pull[j]
        p, q = a.norm(), b.norm()
        along = (p + q) * r - a.dot(r) / ti.max(p, 1e-12) * a - b.dot(r) / ti.max(q, 1e-12) * b
        return self.mass[j] * self._slope(r, gradient) * (self.stress * along + self.hold * r)

    @ti.func
    def _solid(self, x):
        """grad of the share of W that solids fill at x [1/m]; where two meet, the sum of theirs."""
        g = ti.Vector([0.0, 0.0, 0.0])
        for s in range(self.walls.count):
            nd = self.walls.distance(s, x)
            g += poly6_wall(nd[3], self.support_radius)[1] * nd.xyz
        return g

    @ti.func
    def wall_acceleration(self, i):
        """Of particle i by the solids [m/s^2]."""
        return self.cling[i]

    def limit(self) -> Limit:
        """dt <= 0.25 sqrt(rho h^3/(2 pi gamma)), h = H/2.   Brackbill 1992, as in Morris 2000"""
        if not self.tension:
            return Limit(float("inf"), "surface tension")
        seconds = 0.25 * math.sqrt(self.rest_density * self.h**3 / (2.0 * math.pi * self.tension))
        return Limit(seconds, "surface tension")


def _planar_moment() -> float:
    """int_0^H s(|g|) c dz below a flat surface, H = 1, where c is colour and |g| = dc/dz = 315/256 (1 - z^2)^4.

    c, because a layer's stress is borne by pairs, of which the surface leaves that share.
    """
    z = (np.arange(4096) + 0.5) / 4096
    g = 315.0 / 256.0 * (1.0 - z * z) ** 4
    c = 0.5 + (np.cumsum(g) - 0.5 * g) / len(z)
    t = np.clip((g - FAINT) / (PLAIN - FAINT), 0.0, 1.0)
    return float(np.mean(t * t * (3.0 - 2.0 * t) * c))
