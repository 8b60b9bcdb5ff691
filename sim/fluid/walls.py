"""Solids as the water meets them: an analytic share of density, and a last-resort push out of them."""

import numpy as np
import taichi as ti
import taichi.math as tm

from sim.maths.distance import box_distance, plane_distance, sphere_distance
from sim.maths.kernels import KERNELS, wall_fit
from sim.stage import Build
from sim.state import Row

PLANE, BOX, SPHERE = 0, 1, 2
CLEAR = 0.2
"""Water nearer than this many spacings to a solid is put there. At rest it stands at 0.5, held by pressure, so this
acts on the fastest alone; larger would stop what pressure ought to stop."""
PIECES_MAX = 16
"""Pieces that a move is cut into where it is longer than 0.4 spacings, so that no thin wall is jumped."""


@ti.data_oriented
class Walls:
    """Planes, boxes and spheres. A wall is where water at rest stands half a spacing away.

    With lambda the share of the kernel at x_i that solids fill, rho_i += rho0 lambda, and the reaction of pressure is
    the adjoint, a_i = -(p_i/rho_i^2) gradient[i], gradient = rho0 grad lambda (as in Akinci 2012, integrated), so walls
    pump no energy. lambda is steeper and shorter than a half-space's: see sim.maths.kernels.wall_fit.
    Solids overlap in corners: the share of both is lambda_1 lambda_2 where their faces are at right angles (exact at
    the corner), the smaller of the two where they are parallel, none where they are opposite; linear in the cosine.
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
        self.reach, self.offset = (a * fluid.spacing for a in wall_fit(self.kernel, fluid.support))
        primitives = build.scene.solids.primitives
        self.count = len(primitives)
        self.rough = any(p.friction > 0.0 for p in primitives)
        rows = max(self.count, 1)
        self.shape = ti.field(ti.i32, shape=rows)
        self.friction = ti.field(float, shape=rows)
        self.a, self.b = ti.Vector.field(3, float, shape=rows), ti.Vector.field(3, float, shape=rows)
        if primitives:
            names = ("plane", "box", "sphere")
            self.shape.from_numpy(np.array([names.index(p.shape) for p in primitives], np.int32))
            self.friction.from_numpy(np.array([p.friction for p in primitives], float))
            self.a.from_numpy(np.array([p.a for p in primitives], float))
            self.b.from_numpy(np.array([p.b for p in primitives], float))
        build.parts["walls"] = self

    @ti.func
    def distance(self, s, x):
        """(outward normal, distance) of solid s."""
        nd = tm.vec4(0.0, 0.0, 1.0, 1.0)
        if self.shape[s] == PLANE:
            nd = plane_distance(x, self.a[s], self.b[s])
        elif self.shape[s] == BOX:
            nd = box_distance(x, self.a[s], self.b[s])
        else:
            nd = sphere_distance(x, self.a[s], self.b[s][0])
        return nd

    @ti.func
    def meet(self, i):
        """rho0 lambda [kg/m^3] of all solids at x_i; keeps gradient[i] and the friction."""
        share, gradient, friction = self.fill(self.x[i])
        self.gradient[i], self.rub[i] = self.rest_density * gradient, friction
        return self.rest_density * share

    @ti.func
    def fill(self, x):
        """(lambda, grad lambda, friction): of all solids at x, as (1, 1/m, 1); friction of the one that fills most."""
        share, gradient, friction, most = 0.0, tm.vec3(0.0), 0.0, 0.0
        for s in range(self.count):
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
                if part > most:
                    most, friction = part, self.friction[s]
        return share, gradient, friction

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
            along = v - v.dot(n) * n
            v -= along * ti.min(1.0, self.rub[i] * push / ti.max(along.norm(), 1e-12))
        return v

    @ti.func
    def move(self, i, v, dt):
        """(x, v) after dt: straight, but not into a solid; velocity into one that it would enter is taken away."""
        x = self.x[i]
        steps = v.norm() * dt / (0.4 * self.spacing)
        # Out of reach of every solid at the start, a short move needs no look.
        if steps > 1.5 or self.gradient[i].norm_sqr() > 0.0:
            pieces = ti.min(ti.cast(steps, ti.i32), PIECES_MAX - 1) + 1
            for _ in range(pieces):
                x += v * (dt / pieces)
                x, v = self._out(x, v)
        else:
            x += v * dt
        return x, v

    @ti.func
    def _out(self, x, v):
        for s in range(self.count):
            nd = self.distance(s, x)
            missing = CLEAR * self.spacing - nd[3]
            if missing > 0.0:
                x += missing * nd.xyz
                v -= ti.min(v.dot(nd.xyz), 0.0) * nd.xyz
        return x, v
