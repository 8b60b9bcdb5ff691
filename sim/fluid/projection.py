"""The solves for kappa = p/rho^2 >= 0 by accelerated Jacobi iteration, over pairs kept in one list."""

import taichi as ti

from sim import runtime
from sim.crew import BLOCK, Crew, Lists, blocks, rows
from sim.maths.kernels import largest_eigenvalue, lattice_diagonal, lattice_pull

START, DEMAND, PUSH, RELAX, AGAIN, TAKE, TURN = range(7)
"""Phases of the work: see Projection."""
WORST = 0.03
"""[1] No particle may be left with more than this to correct: two drops that met are nothing in the mean, and go on
overlapping."""
GROWTH = 8.0
"""[1] A residual that passes its least by this much is running away: momentum alone overshoots two or three times."""
FAILED = 0.003
"""[1] A solve that ends with more than this left, in the mean, has failed: taken as it is it would blow water up."""
CALM = 0.25
"""Of the lattice's step: without momentum, from no pressure, it cannot push too much, and calms what it leaves."""
SHORTEST = 0.1
"""[1] Of the lattice's step: four halvings."""
SAFETY = 0.6
"""Of Jacobi's largest step on the lattice (0.46 at support 2): disordered water and surfaces bear a little less."""
HEADSTART = 3.0
"""Iterations of momentum that a solve has from its second on: it begins near its end, where Nesterov's slow start only
costs. 0 takes a seventh more iterations; far more do not take fewer."""
FALL = 1.25
"""How fast a pair's push falls with the square of its distance, at the end of the way: so that on the lattice pairs are
slowed across their lines and sped up along them by 3/2 as much, which in even shear comes to no viscosity at all."""
TIGHT = 0.5
"""[1] Share of its velocity that neighbours on a lattice, pushing alike, may take from a particle in a step. Beyond it
the pushes of both sides cancel (water squeezed in a closed box, steps far beyond the limit of speed), and turning each
pair on its own would only rub: at twice this none is turned."""
HOLD = 0.01
"""Of the lattice's diagonal. A particle with less has nothing to push off from: one that is deep in a solid, where the
solids' share is whole and has no slope, would be sent off at kilometres a second."""
FINEST, COARSEST = 2e-6, 1e-3
"""[1] No mean residual of the velocity is asked to be below this, which is all that single precision knows, nor allowed
to be above that."""


@ti.data_oriented
class Projection:
    """Finds kappa with  D rho_i(u) <= (rho0 - rho_i)/dt,  u = v + dt a(kappa),  kappa_i >= 0, one of them equal.

    Projected Jacobi, run ahead by Nesterov's momentum, which starts anew where it points against the residual
    (O'Donoghue & Candes 2015): half of Jacobi's iterations at a tolerance of 1e-4. Twice a step, see Dfsph:

        START, DEMAND, (PUSH, RELAX) ...     of the velocity
        TAKE, (PUSH, RELAX) ..., TURN        of the way

    TURN keeps the spin of water that meets nothing. The way moves particles and leaves v as it is, so sum m x cross v
    would drift. But a push along the lines on which pairs begin, and its opposite along the lines on which they end,
    both keep it to rounding: with the one, the velocity is what moves the particle; after the other, it is nearly v
    again. Beside walls it would cost a sweep and keep nothing, and the lift on small solids suffers. What is left is

        dv_i = dt sum_j m_j (kappa_i + kappa_j) (dW/dr)/r ((1 - fall (r'^2 - r^2)) r' - r),  r' at the end of the way.

    Where particles clump (light ones, soaked half away), the lattice's step is too long and the residual grows: then
    a solve starts AGAIN from no pressure at all, with half the step; and one that fails a last time, calmly.
    owner: free, whether its water meets nothing; has rows v, kappa, kappa_way, guess, density, diagonal, its params,
    the pairs and walls, and u, of four numbers: three, and one that stays 0. u is left at the way, v at the velocity.
    """

    sweeps_before = 1
    """A step's sweeps over the neighbours that are no iteration's: DEMAND."""

    def __init__(self, owner):
        self.o = owner
        self.pairs = owner.pairs
        self.crew = Crew()
        self.relaxation = SAFETY * 2.0 / largest_eigenvalue(self.pairs.kernel, owner.support)
        pull, second, fourth = (lattice_pull(self.pairs.kernel, owner.support, power) for power in (0, 2, 4))
        self.loosest = TIGHT * owner.spacing**2 / (pull * owner.rest_density)
        inside = lattice_diagonal(self.pairs.kernel, owner.support) * (owner.rest_density / owner.spacing) ** 2
        self.least = HOLD * inside
        self.fall = FALL * second / (fourth * owner.spacing**2)
        self.spins = owner.free
        p = owner.params
        self.warm, self.iterations_max = p.warm_start, p.iterations_max
        self.share, self.density_error = p.divergence_error, p.density_error
        capacity = max(owner.state.sizes["fluid"], 1)
        self.sums = runtime.fours(capacity)
        self.pushed = ti.field(float, shape=capacity if self.spins else 1)
        self.partial = ti.Vector.field(3, ti.f64, shape=max(-(-owner.state.sizes["fluid"] // BLOCK), 1))
        self.phase, self.way, self.fresh, self.age, self.calm = (ti.field(ti.i32, ()) for _ in range(5))
        self.iterations = ti.field(ti.i32, 2)
        self.step, self.tolerance, self.first, self.left = (ti.field(ti.f64, ()) for _ in range(4))
        self._lists = None

    def solve(self, dt: float) -> tuple[int, int]:
        """Iterations taken, of the velocity and of the way."""
        self.crew.run(self, dt, self.lists())
        return self.iterations[0], self.iterations[1]

    def lists(self) -> Lists:
        """neighbour and slope of Pairs."""
        if self._lists is None or self._lists.slope is not self.pairs.slope:
            self._lists = Lists(neighbour=self.pairs.neighbour, slope=self.pairs.slope)
        return self._lists

    @ti.func
    def begin(self):
        """Before the first phase."""
        self.phase[None] = START
        self._enter(0)

    @ti.func
    def count(self):
        """Rows."""
        return self.o.state.count[None]

    @ti.func
    def tasks(self):
        """Blocks of rows, in every phase."""
        return blocks(self.o.state.count[None])

    @ti.func
    def work(self, task, dt, lists: ti.template()):
        """A block's share of the phase."""
        first, end = rows(task, self.o.state.count[None])
        self._over_rows(task, first, end, dt, lists)

    @ti.func
    def decide(self):
        """What comes next; whether anything does."""
        return self._next()

    @ti.func
    def _over_rows(self, part, first, end, dt, lists: ti.template()):
        """What the phase does to each row, once its sum is whole."""
        phase, way = self.phase[None], self.way[None]
        total, worst = ti.Vector([0.0, 0.0]), 0.0
        for i in range(first, end):
            if phase == PUSH:
                self._push(i, dt, lists)
            elif phase == TURN:
                if ti.static(self.spins):
                    self.o.v[i] += dt * self._turns(i, dt, lists).xyz
            elif phase == RELAX or phase == DEMAND:
                rate = self._rate(i, lists)
                if phase == RELAX:
                    one = self._relax(i, way, dt, rate)
                    total += one
                    worst = ti.max(worst, one[0])
                else:
                    total[0] += ti.max(rate, 0.0) * dt / self.o.rest_density
            else:
                if phase == TAKE:
                    self.o.take(i, dt)
                elif phase == START:
                    v = self.o.v[i]
                    self.o.u[i] = ti.Vector([v[0], v[1], v[2], 0.0])
                self._begin(i, way)
        self.partial[part] = ti.Vector([total[0], total[1], worst])

    @ti.func
    def _next(self):
        phase, way, more = self.phase[None], self.way[None], True
        if phase == START:
            self.phase[None] = DEMAND
        elif phase == DEMAND:
            asked = self.share * self._mean()[0]
            self.tolerance[None] = ti.math.clamp(asked, ti.f64(FINEST), ti.f64(COARSEST))
            self.phase[None] = PUSH
        elif phase == PUSH:
            self.phase[None] = RELAX
        elif phase == TURN:
            more = False
        elif phase != RELAX:
            self.phase[None] = PUSH
        elif not self._again(way):
            if way == 0:
                self.phase[None], self.tolerance[None] = TAKE, self.density_error
                self._enter(1)
            else:
                self.phase[None], more = TURN, self.spins
        return more

    @ti.func
    def _enter(self, way):
        """A solve's first iteration is ahead, from the last pressure if that is to be had."""
        self.way[None], self.iterations[way], self.calm[None] = way, 0, 0
        self._restart(self.relaxation, 0 if ti.static(self.warm) else 1)

    @ti.func
    def _restart(self, step, fresh):
        """With a step, from the last pressure, or `fresh` from none."""
        self.age[None], self.fresh[None] = 0, fresh
        self.step[None], self.first[None] = step, 1e30

    @ti.func
    def _again(self, way):
        """After an iteration: whether another follows, and how it begins."""
        left, turned, worst = self._mean()
        self.iterations[way] += 1
        self.left[None] = left
        self.first[None] = ti.min(self.first[None], ti.max(left, self.tolerance[None]))
        self.age[None] = 0 if turned > 0.0 or self.calm[None] == 1 else self.age[None] + 1
        more = left > self.tolerance[None] or worst > WORST or ti.math.isnan(left)
        most = self.iterations_max
        if self.calm[None] == 1:
            more = more and self.iterations[way] < most + most // 2
            self.phase[None] = PUSH
        elif self.iterations[way] >= most:
            more = more and not left <= FAILED
            if more:
                self.calm[None], self.phase[None] = 1, AGAIN
                self._restart(CALM * self.relaxation, 1)
        elif more:
            self.phase[None] = PUSH
            if not left <= GROWTH * self.first[None] and self.step[None] > SHORTEST * self.relaxation:
                self.phase[None] = AGAIN
                self._restart(0.5 * self.step[None], 1)
        return more

    @ti.func
    def _parts(self):
        """That rows are summed up in."""
        return blocks(self.o.state.count[None])

    @ti.func
    def _mean(self):
        """Over particles, of the first two partial sums; the largest third."""
        count = self.o.state.count[None]
        left, worst = ti.Vector([0.0, 0.0], ti.f64), ti.f64(0.0)
        for part in range(self._parts()):
            left += self.partial[part].xy
            worst = ti.max(worst, self.partial[part][2])
        left /= ti.max(count, 1)
        return ti.Vector([left[0], left[1], worst])

    @ti.func
    def _rate(self, i, lists: ti.template()):
        """D rho_i/Dt of velocities u, of solids that move too."""
        total = self._rates(i, lists)
        return self.o.walls.rate(i, self.o.u[i].xyz) + total[0] + total[1] + total[2]

    @ti.func
    def _rates(self, i, lists: ti.template()):
        """Pairs' part of it, axis by axis."""
        own, place, total = self.o.u[i], self.pairs.place[i], ti.Vector([0.0, 0.0, 0.0, 0.0])
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            total += self._rate_of(own, place, lists.neighbour[k], lists.slope[k])
        self.sums[i] = total  # four numbers stored are four that the compiler sums at once
        return total

    @ti.func
    def _rate_of(self, own, place, j, slope):
        """A pair's part."""
        return (own - self.o.u[j]) * self.pairs.beyond(place, j) * slope

    @ti.func
    def _kappa(self, i, way):
        found = self.o.kappa[i]
        if way == 1:
            found = self.o.kappa_way[i]
        return found

    @ti.func
    def _keep(self, i, way, kappa):
        if way == 1:
            self.o.kappa_way[i] = kappa
        else:
            self.o.kappa[i] = kappa

    @ti.func
    def _begin(self, i, way):
        start = self._kappa(i, way)
        if self.fresh[None] == 1:
            start = 0.0
        self._keep(i, way, start)
        self.o.guess[i] = start

    @ti.func
    def _push(self, i, dt, lists: ti.template()):
        """u = v + dt a,  a_i = -sum_j m_j (kappa_i + kappa_j) grad W_ij - kappa_i rho0 grad lambda_i."""
        v, wall = self.o.v[i], self.o.guess[i] * self.o.walls.gradient[i]
        a = self._pushes(i, ti.Vector([wall[0], wall[1], wall[2], 0.0]), lists)
        self.o.u[i] = ti.Vector([v[0], v[1], v[2], 0.0]) - dt * a

    @ti.func
    def _pushes(self, i, a, lists: ti.template()):
        """a, and what pairs add to it."""
        own, place = self.o.guess[i], self.pairs.place[i]
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            a += self._push_of(own, place, lists.neighbour[k], lists.slope[k])
        return a

    @ti.func
    def _push_of(self, own, place, j, slope):
        """A pair's part."""
        return ((own + self.o.guess[j]) * slope) * self.pairs.beyond(place, j)

    @ti.func
    def _turns(self, i, dt, lists: ti.template()):
        """dv/dt by the way's push where pairs begin, less the same where they end: see Projection."""
        own, u, place = self.pushed[i], self.o.u[i], self.pairs.place[i]
        a = ti.Vector([0.0, 0.0, 0.0, 0.0])
        for k in range(self.pairs.start[i], self.pairs.stop[i]):
            a += self._turn_of(own, u, place, dt, lists.neighbour[k], lists.slope[k])
        self.sums[i] = a  # stored whole, as in `_rates`
        return a

    @ti.func
    def _turn_of(self, own, u, place, dt, j, slope):
        """A pair's part."""
        r, moved = self.pairs.beyond(place, j), dt * (u - self.o.u[j])
        end = r + moved
        less = ti.max(-self.fall * moved.dot(r + end), -1.0)
        return ((own + self.pushed[j]) * slope) * (moved + less * end)

    @ti.func
    def _relax(self, i, way, dt, rate):
        """kappa_i by its residual rate - (rho0 - rho)/dt; |what that corrects| dt/rho0, and momentum's turn.

        The way takes density errors back; the velocity stops compression alone.
        """
        rho0, diagonal = self.o.rest_density, ti.max(self.o.diagonal[i], self.least)
        lack = (rho0 - self.o.density[i]) / dt
        if way == 0:
            lack = ti.max(lack, 0.0)
        step, ahead = ti.cast(self.step[None], float), 0.0
        if self.age[None] > 0:
            ahead = (self.age[None] + HEADSTART) / (self.age[None] + HEADSTART + 1.0)
        old, guess = self._kappa(i, way), self.o.guess[i]
        new = ti.max(guess + step * (rate - lack) / (dt * diagonal), 0.0)
        self._keep(i, way, new)
        self.o.guess[i] = ti.max(new + ahead * (new - old), 0.0)
        if ti.static(self.spins):
            self.pushed[i] = guess * ti.math.clamp(2.0 - 2.0 * dt * dt * guess / self.loosest, 0.0, 1.0)
        left = diagonal * dt * dt / rho0
        return ti.Vector([ti.abs(new - guess) * left / step, (guess - new) * (new - old) * left])
