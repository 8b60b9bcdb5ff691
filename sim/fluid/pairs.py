"""What every sweep over neighbours reads: W and grad W of each pair, kept for the step."""

import numpy as np
import taichi as ti

from sim.errors import CapacityError
from sim.maths.kernels import KERNELS, lattice_shares
from sim.search.torus import Torus
from sim.stage import Build, Stage
from sim.state import Row


@ti.data_oriented
class Pairs:
    """Pairs of row i are k = start[i] ... stop[i] - 1, with j = neighbour[k], and

        weight[k]    m_j W_ij        [kg/m^3]   so that rho_i = self_weight m_i + sum_k weight[k] + walls
        gradient[k]  m_j grad_i W_ij [kg/m^4]   a vector; m_i gradient_ij = -m_j gradient_ji up to rounding

    Every sweep of the step reads these and never positions, so zeroing both of a pair (and of its mirror) takes it out.
    All are fields; the two of a pair lie side by side, 16 bytes, for sweeps that take them at once (see `both`).
    neighbour, weight, gradient are replaced by longer ones when a list does not fit: pass them to
    kernels as arguments, fetched from here at each call.

        @ti.kernel
        def cut(self, neighbour: ti.template(), weight: ti.template(), gradient: ti.template()):
            for i in range(count[None]):
                for k in range(pairs.start[i], pairs.stop[i]):
                    if cut_between(i, neighbour[k]):
                        weight[k] = 0.0
                        gradient[k] = ti.Vector([0.0, 0.0, 0.0])
    """

    rows = ("fluid.x", "fluid.mass")
    scratch = (
        Row("fluid.pairs.inverse_mass", "f", "1/kg", "spares a division a pair", saved=False),
        Row("fluid.pairs.density", "f", "kg/m^3", "by true masses, when the guard asks", saved=False),
    )

    def __init__(self, build: Build):
        fluid = build.config.fluid
        self.state, self.list = build.state, build.parts["search"].list
        self.x, self.mass = build.state["fluid.x"], build.state["fluid.mass"]
        self.inverse_mass, self.total = (build.state[row.name] for row in self.scratch)
        self.torus = Torus(build.config.space)
        self.start, self.stop = self.list.start, self.list.stop
        self.kernel = KERNELS[fluid.kernel]
        self.support_radius = fluid.support_radius
        self.scale = 1.0 / lattice_shares(self.kernel, fluid.support)[0]
        self.self_weight = self.scale * self.kernel.value(0.0, self.support_radius)
        self.weight = self.gradient = None
        build.parts["pairs"] = self

    @property
    def neighbour(self):
        """j of each pair."""
        return self.list.neighbour

    def stages(self) -> tuple[Stage, ...]:
        """One stage, after the search."""
        return (Stage("pairs", "sort", lambda dt: self.weigh(), self.rows, ()),)

    def weigh(self) -> None:
        """Fill weight and gradient from positions and masses."""
        length = self.neighbour.shape[0]
        if self.weight is None or self.weight.shape[0] != length:
            try:
                self.weight, self.gradient = ti.field(float), ti.Vector.field(3, float)
                ti.root.dense(ti.i, length).place(self.gradient, self.weight)
            except RuntimeError as error:
                raise CapacityError(f"fluid: no memory for {length} pairs; use a larger spacing") from error
        self._weigh(self.neighbour, self.weight, self.gradient)

    @ti.func
    def apart(self, x, j):
        """x - x_j, of the nearest image in periodic space: every difference of places is taken here."""
        return self.torus.nearest(x - self.x[j])

    @ti.func
    def both(self, k, weight: ti.template(), gradient: ti.template()):
        """(gradient, weight) of pair k as one: a sum of four is taken as fast as one of a single number."""
        g = gradient[k]
        return ti.Vector([g[0], g[1], g[2], weight[k]])

    def density(self) -> np.ndarray:
        """sum_j m_j W_ij of the last list [kg/m^3], by true masses and without solids: for the guard, row by row."""
        self._sum(self.weight)
        return self.total.to_numpy()

    @ti.kernel
    def _sum(self, weight: ti.template()):
        for i in range(self.state.count[None]):
            rho = self.self_weight * self.mass[i]
            for k in range(self.start[i], self.stop[i]):
                rho += weight[k]
            self.total[i] = rho

    @ti.kernel
    def _weigh(self, neighbour: ti.template(), weight: ti.template(), gradient: ti.template()):
        for i in range(self.state.count[None]):
            x = self.x[i]
            self.inverse_mass[i] = 1.0 / self.mass[i]
            for k in range(self.start[i], self.stop[i]):
                j = neighbour[k]
                r = self.apart(x, j)
                distance = r.norm()
                share = self.scale * self.mass[j]
                weight[k] = share * self.kernel.value(distance, self.support_radius)
                gradient[k] = share * self.kernel.slope(distance, self.support_radius) * r
