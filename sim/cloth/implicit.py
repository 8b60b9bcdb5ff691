"""Backward Euler: the sheet's forces are those at the step's end, so no step is too long to be stable."""

import taichi as ti

from sim.cloth.board import LANES
from sim.cloth.damping import Damped
from sim.cloth.forces import SpringForces
from sim.cloth.xpbd import Xpbd
from sim.model import quantity
from sim.registry import register
from sim.stage import Build


@register("cloth.solver", "implicit_euler")
@ti.data_oriented
class ImplicitEuler(Xpbd):
    """M (x - x*)/h^2 = f(x), x* = x0 + h v0 + h^2 g, by Newton's method; each step of it by conjugate gradients.

    (M + h^2 K) u = M (x* - y) + h^2 f(y), x = y + u, without a matrix (Baraff & Witkin 1998). K is that of springs
    whose pull across their direction, negative when they are short, is left out (Choi & Ko 2002), so that it stays
    positive. Preconditioned by the masses alone: K moves no centre of mass, hence no iterate of the solve does.
    Clips, guests, contact, tethers and settling as `xpbd` has them; the strain limit by one sweep a substep.
    """

    class Params(Damped):
        """[cloth.implicit_euler]"""

        substep_max: float = quantity("5 ms", "time", ge=1e-9, why="longer ones damp the swing that is to be seen")
        newton: int = quantity(1, ge=1, le=50, why="steps of Newton's method a substep; more where it turns far")
        tolerance: float = quantity("0.01 m/s^2", "acceleration", gt=0, why="rms that a solve leaves; gravity is 9.8")
        iterations_max: int = quantity(
            500, ge=1, le=100000, why="of conjugate gradients; a sheet n nodes across needs some 3 n"
        )

    elastic = 0.0

    def __init__(self, build: Build, params: "ImplicitEuler.Params"):
        super().__init__(build, params)
        self.forces = SpringForces(self.sheet.families, self.board)
        self.at, self.u, self.left, self.way, self.answer = (
            [ti.field(self.board.real, self.board.half) for _ in range(3)] for _ in range(5)
        )
        self.m = ti.field(self.board.real, self.board.half)
        self.count = ti.field(ti.i32, 2)

    def substep_max(self) -> float:
        """cloth.implicit_euler.substep_max [s]."""
        return self.params.substep_max

    def iterations(self) -> tuple[int, int]:
        """Solves, and iterations of all of them, so far."""
        return int(self.count[0]), int(self.count[1])

    @ti.func
    def _resist(self, h):
        for turn in range(self.params.newton):
            self._linearise(turn)
            self._solve(h * h)
            for block in range(self.board.half // LANES):
                at = block * LANES
                for d in ti.static(range(3)):
                    y = self.board.get(self.at[d], at) + self.board.get(self.u[d], at)
                    self.board.put(self.at[d], at, y)
        for at in range(self.board.half):
            for d in ti.static(range(3)):
                self.board.x[d][at] = self.at[d][at]

    @ti.func
    def _linearise(self, turn):
        """y = at: first the substep's start; left = M (x* - y); u = way: a guess."""
        for block in range(self.board.half // LANES):
            at = block * LANES
            w = self.board.get(self.board.w, at)
            mass = ti.select(w > 0.0, 1.0 / ti.max(w, 1e-300), 0.0)
            self.board.put(self.m, at, mass)
            for d in ti.static(range(3)):
                y = self.board.get(self.at[d], at)
                if turn == 0:
                    y = self.board.get(self.board.start[d], at)
                ahead = self.board.get(self.board.x[d], at) - y
                guess = ahead if turn == 0 else 0.0 * ahead
                self.board.put(self.at[d], at, y)
                self.board.put(self.left[d], at, mass * ahead)
                self.board.put(self.u[d], at, guess)
                self.board.put(self.way[d], at, guess)

    @ti.func
    def _solve(self, h_sq):
        """u, until the acceleration that is left is within tolerance: rms, M^-1 r/h^2."""
        rest, goal, turns = ti.cast(1.0, self.board.real), ti.cast(0.0, self.board.real), 0
        for turn in range(self.params.iterations_max + 1):
            if rest > goal:
                self._apply(h_sq, 1.0 if turn == 0 else 0.0)
                if turn == 0:
                    rest = self._first_rest()
                    goal = (self.params.tolerance * h_sq) ** 2 * self._mass()
                else:
                    before = rest
                    rest = self._step(rest / ti.max(self._curve(), 1e-300))
                    self._turn(rest / before)
                    turns = turn
        self.count[0] += 1
        self.count[1] += turns

    @ti.func
    def _apply(self, h_sq, forces):
        """answer = (M + h^2 K) way - forces h^2 f(y)."""
        for block in range(self.board.half // LANES):
            at = block * LANES
            mass = self.board.get(self.m, at)
            for d in ti.static(range(3)):
                way = self.board.get(self.way[d], at)
                self.board.put(self.answer[d], at, mass * way)
                self.board.put(self.pull[d], at, way + forces * self.board.get(self.at[d], at))
        self.forces.add_change(self.answer, self.at, self.way, h_sq, forces)
        self.bending.add(self.answer, self.pull, -h_sq)  # linear: f(y) - Q way = -Q (y + way)

    @ti.func
    def _first_rest(self):
        """r = left - answer; way = M^-1 r; r . M^-1 r."""
        total = 0.0 * self.board.get(self.m, 0)
        for block in range(self.board.half // LANES):
            at = block * LANES
            w = self.board.get(self.board.w, at)
            for d in ti.static(range(3)):
                r = self.board.get(self.left[d], at) - self.board.get(self.answer[d], at)
                self.board.put(self.left[d], at, r)
                self.board.put(self.way[d], at, w * r)
                total += w * r * r
        return total.sum()

    @ti.func
    def _mass(self):
        """Of the nodes that are free."""
        total = 0.0 * self.board.get(self.m, 0)
        for block in range(self.board.half // LANES):
            total += self.board.get(self.m, block * LANES)
        return total.sum()

    @ti.func
    def _curve(self):
        """way . answer."""
        total = 0.0 * self.board.get(self.m, 0)
        for block in range(self.board.half // LANES):
            at = block * LANES
            for d in ti.static(range(3)):
                total += self.board.get(self.way[d], at) * self.board.get(self.answer[d], at)
        return total.sum()

    @ti.func
    def _step(self, length):
        """u += length way, r -= length answer; r . M^-1 r."""
        total = 0.0 * self.board.get(self.m, 0)
        for block in range(self.board.half // LANES):
            at = block * LANES
            w = self.board.get(self.board.w, at)
            for d in ti.static(range(3)):
                u = self.board.get(self.u[d], at) + length * self.board.get(self.way[d], at)
                r = self.board.get(self.left[d], at) - length * self.board.get(self.answer[d], at)
                self.board.put(self.u[d], at, u)
                self.board.put(self.left[d], at, r)
                total += w * r * r
        return total.sum()

    @ti.func
    def _turn(self, share):
        """way = M^-1 r + share way."""
        for block in range(self.board.half // LANES):
            at = block * LANES
            w = self.board.get(self.board.w, at)
            for d in ti.static(range(3)):
                way = w * self.board.get(self.left[d], at) + share * self.board.get(self.way[d], at)
                self.board.put(self.way[d], at, way)
