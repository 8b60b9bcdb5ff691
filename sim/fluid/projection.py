"""The solve for kappa = p/rho^2 >= 0 by accelerated Jacobi iteration, over pairs kept in one list."""

import taichi as ti

from sim import runtime
from sim.maths.kernels import largest_eigenvalue
from sim.runtime import TURNS

BLOCK = 1024
"""Particles in one partial sum. Sums over blocks in order, then over the blocks in order, have the same bits on any
number of threads."""
WORST = 0.03
"""[1] No particle may be left with more than this to correct: two drops that met are nothing in the mean, and go on
overlapping."""
GROWTH = 8.0
"""[1] A residual that passes its least by this much is running away: momentum alone overshoots two or three times."""
SHORTEST = 0.1
"""[1] Of the lattice's step: four halvings."""
SAFETY = 0.6
"""Of Jacobi's largest step on the lattice (0.46 at support 2): disordered water and surfaces bear a little less."""


@ti.data_oriented
class Projection:
    """Finds kappa with  D rho_i(u) <= (rho0 - rho_i)/dt,  u = v + dt a(kappa),  kappa_i >= 0, one of them equal.

    Projected Jacobi, run ahead by Nesterov's momentum, which starts anew where it points against the residual
    (O'Donoghue & Candes 2015): half of Jacobi's iterations at a tolerance of 1e-4.
    owner: has rows v, u, guess, density, diagonal, and the pairs and walls; u is left at the solution.
    """

    def __init__(self, owner):
        self.o = owner
        self.pairs = owner.pairs
        capacity = owner.state.sizes["fluid"]
        self.relaxation = SAFETY * 2.0 / largest_eigenvalue(self.pairs.kernel, owner.support)
        self.few = runtime.few(capacity)
        self.partial = ti.Vector.field(3, ti.f64, shape=max(-(-capacity // BLOCK), 1))

    def solve(self, kappa, dt: float, tolerance: float, iterations_max: int, correct: float) -> int:
        """Iterations taken. tolerance: mean |change of density in dt| left, over rho0. correct: 1 takes density errors
        back, 0 stops compression alone (see Dfsph).

        Where particles clump (light ones, soaked half away), the lattice's step is too long and the residual grows:
        then it starts anew from no pressure at all, with half the step.
        """
        if not self.o.params.warm_start:
            kappa.fill(0.0)
        self._begin(kappa)
        age = iteration = 0
        left = worst = first = float("inf")
        step = self.relaxation
        while (left > tolerance or worst > WORST) and iteration < iterations_max:
            self._push(dt, self.pairs.neighbour, self.pairs.gradient)
            left, turned, worst = self._relax(
                kappa, dt, correct, step, age / (age + 3.0), self.pairs.neighbour, self.pairs.gradient
            )
            first = min(first, max(left, tolerance))
            age = 0 if turned > 0.0 else age + 1
            iteration += 1
            if not left <= GROWTH * first and step > SHORTEST * self.relaxation:
                kappa.fill(0.0)
                self._begin(kappa)
                step, age, first = 0.5 * step, 0, float("inf")
        return iteration

    def demand(self, dt: float) -> float:
        """Mean over particles of the compression that v would bring within dt [1]."""
        return self._demand(dt, self.pairs.neighbour, self.pairs.gradient)[0]

    @ti.kernel
    def _demand(self, dt: float, neighbour: ti.template(), gradient: ti.template()) -> ti.types.vector(3, ti.f64):
        count = self.o.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                total = 0.0
                for i in range(turn // TURNS * BLOCK, ti.min((turn // TURNS + 1) * BLOCK, count)):
                    total += ti.max(self._rate(self.o.v, i, neighbour, gradient), 0.0) * dt / self.o.rest_density
                self.partial[turn // TURNS] = ti.Vector([total, 0.0, 0.0])
        return self._mean(count)

    @ti.func
    def _rate(self, u: ti.template(), i, neighbour: ti.template(), gradient: ti.template()):
        """D rho_i/Dt of velocities u, of solids that move too."""
        own = u[i]
        rate = self.o.walls.rate(i, own)
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            rate += (own - u[neighbour[k]]).dot(gradient[k])
        return rate

    @ti.func
    def _mean(self, count):
        """Over particles, of the first two partial sums; the largest third."""
        left, worst = ti.Vector([0.0, 0.0], ti.f64), ti.f64(0.0)
        ti.loop_config(serialize=True)
        for block in range((count + BLOCK - 1) // BLOCK):
            left += self.partial[block].xy
            worst = ti.max(worst, self.partial[block][2])
        left /= ti.max(count, 1)
        return ti.Vector([left[0], left[1], worst])

    @ti.kernel
    def _begin(self, kappa: ti.template()):
        ti.loop_config(serialize=self.few)
        for i in range(self.o.state.count[None]):
            self.o.guess[i] = kappa[i]

    @ti.kernel
    def _push(self, dt: float, neighbour: ti.template(), gradient: ti.template()):
        """u = v + dt a,  a_i = -sum_j m_j (kappa_i + kappa_j) grad W_ij - kappa_i rho0 grad lambda_i."""
        for i in range(self.o.state.count[None]):
            own = self.o.guess[i]
            a = own * self.o.walls.gradient[i]
            for k in range(self.pairs.start[i], self.pairs.stop[i]):
                a += (own + self.o.guess[neighbour[k]]) * gradient[k]
            self.o.u[i] = self.o.v[i] - dt * a

    @ti.kernel
    def _relax(
        self,
        kappa: ti.template(),
        dt: float,
        correct: float,
        step: float,
        momentum: float,
        neighbour: ti.template(),
        gradient: ti.template(),
    ) -> ti.types.vector(3, ti.f64):
        """One step of kappa. Of |change of density in dt| that it still corrects over rho0: the mean, and last the
        largest; between them the mean of momentum's turn."""
        count = self.o.state.count[None]
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                self._relax_block(kappa, turn // TURNS, dt, correct, step, momentum, neighbour, gradient)
        return self._mean(count)

    @ti.func
    def _relax_block(
        self,
        kappa: ti.template(),
        block,
        dt,
        correct,
        step,
        momentum,
        neighbour: ti.template(),
        gradient: ti.template(),
    ):
        count = self.o.state.count[None]
        total, worst = ti.Vector([0.0, 0.0]), 0.0
        for i in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
            rate = self._rate(self.o.u, i, neighbour, gradient)
            one = self._step(kappa, i, rate, dt, correct, step, momentum)
            total += one
            worst = ti.max(worst, one[0])
        self.partial[block] = ti.Vector([total[0], total[1], worst])

    @ti.func
    def _step(self, kappa: ti.template(), i, rate, dt, correct, step, momentum):
        """Relax kappa_i by its residual rate - (rho0 - rho)/dt; |what that corrects| dt/rho0, and momentum's turn."""
        rho0, diagonal = self.o.rest_density, ti.max(self.o.diagonal[i], 1e-20)
        lack = (rho0 - self.o.density[i]) / dt
        if correct == 0.0:
            lack = ti.max(lack, 0.0)
        old, guess = kappa[i], self.o.guess[i]
        new = ti.max(guess + step * (rate - lack) / (dt * diagonal), 0.0)
        kappa[i] = new
        self.o.guess[i] = ti.max(new + momentum * (new - old), 0.0)
        left = diagonal * dt * dt / rho0
        return ti.Vector([ti.abs(new - guess) * left / step, (guess - new) * (new - old) * left])
