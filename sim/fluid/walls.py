"""Solids as the water meets them: an analytic share of density, and a last-resort push out of them."""

import taichi as ti
import taichi.math as tm

from sim.bodies import Bodies
from sim.maths.kernels import KERNELS, wall_fit
from sim.search.torus import Torus
from sim.stage import Build
from sim.state import Row

CLEAR = 0.2
"""Water nearer than this many spacings to a solid is put there. At rest it stands at 0.5, held by pressure, so this
acts on the fastest alone; larger would stop what pressure ought to stop."""
PIECES_MAX = 16
"""Pieces that a move is cut into where it is longer than 0.4 spacings, so that no thin wall is jumped."""


@ti.data_oriented
class Walls:
    """Solids, still or moving. A wall is where water at rest stands half a spacing away.

    With lambda the share of the kernel at x_i that solids fill, rho_i += rho0 lambda, and the reaction of pressure is
    the adjoint, a_i = -(p_i/rho_i^2) gradient[i], gradient = rho0 grad lambda (as in Akinci 2012, integrated), so walls
    pump no energy. lambda is steeper and shorter than a half-space's: see sim.maths.kernels.wall_fit.
    Solids overlap in corners: the share of both is lambda_1 lambda_2 where their faces are at right angles (exact at
    the corner), the smaller of the two where they are parallel, none where they are opposite; linear in the cosine.
    Where solids move, D rho_i/Dt = rate(i, u_i): what they sweep together counts like what particles do.
    """

    rows = ("fluid.x",)
    scratch = (
        Row("fluid.walls.gradient", "v", "kg/m^4", "rho0 grad lambda", saved=False),
        Row("fluid.walls.friction", "f", "1", "of the solid that fills most", saved=False),
    )

    def __init__(self, build: Build):
        fluid = build.config.fluid
        self.x = build.state["fluid.x"]
        self.gradient, self.rub = (build.state[row.name] for row in self.scratch)
        self.rest_density = fluid.liquid.rest_density
        self.spacing = fluid.spacing
        self.kernel = KERNELS[fluid.kernel]
        self.torus = Torus(build.config.space)
        self.reach, self.offset = (a * fluid.spacing for a in wall_fit(self.kernel, fluid.support))
        self.bodies = Bodies.of(build)
        self.count, self.rough = self.bodies.count, self.bodies.rough
        capacity = max(build.state.sizes["fluid"], 1)
        self.stopped = ti.Vector.field(3, float, shape=capacity)
        if self.bodies.moves:
            self.swept = ti.field(float, shape=capacity)
            self.carried = ti.Vector.field(3, float, shape=capacity)
        build.parts["walls"] = self

    @ti.func
    def distance(self, s, x):
        """(outward normal, distance [m]) of solid s at x, or of its image nearest to x."""
        if ti.static(len(self.torus.axes) > 0):
            x = self.bodies.centre[s] + self.torus.nearest(x - self.bodies.centre[s])
        return self.bodies.distance(s, x)

    @ti.func
    def nearer(self, s, x, reach):
        """May solid s, or its image, be nearer than `reach` to x?"""
        return self.bodies.beside(s, self.torus.nearest(x - self.bodies.centre[s])) < reach

    @ti.func
    def meet(self, i):
        """rho0 lambda [kg/m^3] of all solids at x_i; keeps gradient[i], the friction, and how the solids move."""
        return self.meet_at(i, self.x[i])

    @ti.func
    def meet_at(self, i, x):
        """As if particle i were at x."""
        share, gradient, friction, swept, carried = self.fill(x)
        self.gradient[i], self.rub[i] = self.rest_density * gradient, friction
        if ti.static(self.bodies.moves):
            self.swept[i], self.carried[i] = self.rest_density * swept, carried
        return self.rest_density * share

    @ti.func
    def rate(self, i, u):
        """What solids add to D rho_i/Dt of a particle that moves at u: sum over them of (u - u_s) . rho0 grad lambda_s
        [kg/(m^3 s)]."""
        found = u.dot(self.gradient[i])
        if ti.static(self.bodies.moves):
            found -= self.swept[i]
        return found

    @ti.func
    def velocity(self, i):
        """Of the solid that fills most of the reach of particle i [m/s]; 0 where there is none, or it stands still."""
        u = tm.vec3(0.0)
        if ti.static(self.bodies.moves):
            u = self.carried[i]
        return u

    @ti.func
    def fill(self, x):
        """(lambda, grad lambda, friction, sum of u_s . grad lambda_s, u_s): of all solids at x, as (1, 1/m, 1, 1/s,
        m/s); friction and velocity of the one that fills most."""
        share, gradient, friction, most = 0.0, tm.vec3(0.0), 0.0, 0.0
        swept, carried = 0.0, tm.vec3(0.0)
        for s in range(self.count):
            if self.nearer(s, x, self.reach - self.offset):
                nd = self.distance(s, x)
                if nd[3] + self.offset < self.reach:
                    part, slope = self.kernel.wall(nd[3] + self.offset, self.reach)
                    towards = slope * nd.xyz
                    cosine = 0.0
                    if share > 0.0:
                        cosine = gradient.dot(towards) / ti.max(gradient.norm() * ti.abs(slope), 1e-30)
                    both, by_share, by_part = self._overlap(share, part, cosine)
                    share += part - both
                    gradient = (1.0 - by_share) * gradient + (1.0 - by_part) * towards
                    u = self.bodies.velocity(s, x)
                    swept = (1.0 - by_share) * swept + (1.0 - by_part) * towards.dot(u)
                    if part > most:
                        most, friction, carried = part, self.bodies.friction[s], u
        return share, gradient, friction, swept, carried

    @ti.func
    def _overlap(self, a, b, cosine):
        """Share that two solids fill both, and its derivatives by a and by b."""
        corner = 1.0 - ti.abs(cosine)
        along = ti.max(cosine, 0.0)
        first = ti.cast(a < b, float)
        return (
            corner * a * b + along * ti.min(a, b),
            corner * b + along * first,
            corner * a + along * (1.0 - first),
        )

    @ti.func
    def slow(self, i, v, push):
        """v after Coulomb's friction on a particle that the walls pushed by `push` [m/s]: |dv_t| <= friction push."""
        if push > 0.0:
            n = self.gradient[i].normalized()
            past = v - self.velocity(i)
            along = past - past.dot(n) * n
            v -= along * ti.min(1.0, self.rub[i] * push / ti.max(along.norm(), 1e-12))
        return v

    @ti.func
    def move(self, i, v, dt):
        """(x, v) after dt: straight, but not into a solid; velocity into one that it would enter is taken away, and
        kept in stopped[i] [m/s] until the next move."""
        x, before = self.x[i], v
        steps = v.norm() * dt / (0.4 * self.spacing)
        # Out of reach of every solid at the start, a short move needs no look.
        if steps > 1.5 or self.gradient[i].norm_sqr() > 0.0:
            pieces = ti.min(ti.cast(steps, ti.i32), PIECES_MAX - 1) + 1
            for _ in range(pieces):
                x += v * (dt / pieces)
                x, v = self._out(x, v)
        else:
            x += v * dt
        self.stopped[i] = before - v
        return x, v

    @ti.func
    def _out(self, x, v):
        for s in range(self.count):
            if self.nearer(s, x, CLEAR * self.spacing):
                nd = self.distance(s, x)
                missing = CLEAR * self.spacing - nd[3]
                if missing > 0.0:
                    into = ti.min((v - self.bodies.velocity(s, x)).dot(nd.xyz), 0.0)
                    x += missing * nd.xyz
                    v -= into * nd.xyz
        return x, v
