"""Solids that hold the water's skin: the share of viscosity that a wall fills."""

import numpy as np
import taichi as ti
import taichi.math as tm

from sim.maths.kernels import KERNELS
from sim.stage import Build

NEAREST = 0.25
"""Spacings: the drag of a wall grows as 1/d, and dt knows nothing of a particle pressed closer than this."""


@ti.data_oriented
class WallViscosity:
    """a_i = sum over solids with no_slip of 2 nu lambda'(d)/d (v_i - u)   [m/s^2], d the distance of the wall.

    It is the viscous integral over the half-space beyond the wall, filled with water whose velocity goes on in a
    straight line through the wall's own (Morris 1997, section 3.3): with s the part of x_i - x_j across the wall,
    v_i - v_j = (v_i - u) s/d, and int 2 nu s/d (dW/dr)/r dV = 2 nu lambda'(d)/d, lambda the kernel's true share.
    On a lattice it is within 4 % of the sum over such water. u: the wall's velocity, and what slides along it.
    """

    def __init__(self, build: Build, nu: float):
        fluid, solids = build.config.fluid, build.config.solid
        self.x, self.v, self.walls = build.state["fluid.x"], build.state["fluid.v"], build.parts["walls"]
        self.kernel, self.support_radius = KERNELS[fluid.kernel], fluid.support_radius
        self.nu, self.nearest = nu, NEAREST * fluid.spacing
        of = [solids[p.solid] for p in build.scene.solids.primitives]
        self.some = any(s.no_slip for s in of)
        self.holds = ti.field(ti.i32, shape=max(len(of), 1))
        self.slide = ti.Vector.field(3, float, shape=max(len(of), 1))
        if of:
            self.holds.from_numpy(np.array([s.no_slip for s in of], np.int32))
            self.slide.from_numpy(np.array([s.slide for s in of], float))

    @ti.func
    def drag(self, i):
        """(c, c u) with a_i = c u - c v_i: rate [1/s], and rate times the walls' velocity [m/s^2]."""
        rate, push = 0.0, tm.vec3(0.0)
        for s in range(self.walls.count):
            if self.holds[s]:
                nd = self.walls.distance(s, self.x[i])
                if nd[3] < self.support_radius:
                    d = ti.max(nd[3], self.nearest)
                    c = -2.0 * self.nu * self.kernel.wall(d, self.support_radius)[1] / d
                    belt = self.slide[s]
                    rate += c
                    push += c * (self.walls.bodies.velocity(s, self.x[i]) + belt - belt.dot(nd.xyz) * nd.xyz)
        return rate, push

    @ti.func
    def acceleration(self, i):
        """Of particle i by all walls [m/s^2]."""
        rate, push = self.drag(i)
        return push - rate * self.v[i]
