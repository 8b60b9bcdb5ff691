"""What every sweep over neighbours reads: W and grad W of each pair, kept for the step."""

import numpy as np
import taichi as ti

from sim import runtime
from sim.errors import CapacityError
from sim.maths.kernels import KERNELS, lattice_shares
from sim.search.sieve import ENTRIES, LANES
from sim.search.torus import Torus
from sim.stage import Build, Stage
from sim.state import Row


@ti.data_oriented
class Pairs:
    """Pairs of row i are k = start[i] ... stop[i] - 1, with j = neighbour[k], and

        weight[k]  m_j W_ij          [kg/m^3]   so that rho_i = self_weight m_i + sum_k weight[k] + walls
        slope[k]   m_j (dW/dr)/r     [kg/m^5]   m_j grad_i W_ij = slope[k] (x_i - x_j), see `apart` and `beyond`

    Every sweep of the step takes pairs from these, so zeroing both of a pair (and of its mirror) takes it out. Sweeps
    over much water are as fast as memory is: the places of neighbours lie in the cache, vectors of pairs would not.
    All are fields. neighbour, weight, slope are replaced by longer ones when a list does not fit: pass them to
    kernels as arguments, fetched from here at each call.

        @ti.kernel
        def cut(self, neighbour: ti.template(), weight: ti.template(), slope: ti.template()):
            for i in range(count[None]):
                for k in range(pairs.start[i], pairs.stop[i]):
                    if cut_between(i, neighbour[k]):
                        weight[k] = 0.0
                        slope[k] = 0.0
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
        self.place = runtime.fours(max(build.state.sizes["fluid"], 1))
        self.reals, self.rows_of_eight = ti.types.vector(LANES, float), ti.types.vector(LANES, ti.i32)
        self.weight = self.slope = None
        build.parts["pairs"] = self

    @property
    def neighbour(self):
        """j of each pair."""
        return self.list.neighbour

    def stages(self) -> tuple[Stage, ...]:
        """One stage, after the search."""
        return (Stage("pairs", "sort", lambda dt: self.weigh(), self.rows, ()),)

    def weigh(self) -> None:
        """Fill weight and slope from positions and masses."""
        length = self.neighbour.shape[0]
        if self.weight is None or self.weight.shape[0] != length:
            try:
                self.weight, self.slope = ti.field(float, shape=length), ti.field(float, shape=length)
            except RuntimeError as error:
                raise CapacityError(f"fluid: no memory for {length} pairs; use a larger spacing") from error
        self._weigh(self.neighbour, self.weight, self.slope)

    @ti.func
    def apart(self, x, j):
        """x - x_j, of the nearest image in periodic space: every difference of places is taken here."""
        return self.torus.nearest(x - self.x[j])

    @ti.func
    def beyond(self, place, j):
        """place - place_j, as `apart`: (x, y, z, 0), since the compiler takes four at once, and three one by one."""
        return self.torus.nearest(place - self.place[j])

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
    def _weigh(self, neighbour: ti.template(), weight: ti.template(), slope: ti.template()):
        for i in range(self.state.count[None]):
            x = self.x[i]
            self.place[i] = ti.Vector([x[0], x[1], x[2], 0.0])
            self.inverse_mass[i] = 1.0 / self.mass[i]
            begin, end = self.start[i], self.stop[i]
            whole = begin + (end - begin) // LANES * LANES
            k = begin
            while k < whole:
                self._weigh_eight(x, k & ENTRIES, neighbour, weight, slope)
                k += LANES
            for last in range(whole, end):
                j = neighbour[last]
                weight[last], slope[last] = self._shares(self.apart(x, j).norm(), self.mass[j])

    @ti.func
    def _weigh_eight(self, x, first, neighbour: ti.template(), weight: ti.template(), slope: ti.template()):
        """Pairs `first` and the seven that follow, the same to the bit as one by one: two thirds of the time."""
        j = self.rows_of_eight([neighbour[first + n] for n in range(LANES)])
        square = self.reals(0.0)
        for a in ti.static(range(3)):
            r = self.torus.nearest_along(a, x[a] - self.reals([self.x[j[n]][a] for n in range(LANES)]))
            square += r * r
        weights, slopes = self._shares(ti.sqrt(square), self.reals([self.mass[j[n]] for n in range(LANES)]))
        for n in ti.static(range(LANES)):
            weight[first + n] = weights[n]
        for n in ti.static(range(LANES)):
            slope[first + n] = slopes[n]

    @ti.func
    def _shares(self, distance, mass):
        """m_j W and m_j (dW/dr)/r at a distance; of several at once, if both are vectors of them."""
        share = self.scale * mass
        return (
            share * self.kernel.value(distance, self.support_radius),
            share * self.kernel.slope(distance, self.support_radius),
        )
