"""Explicit solvers: every spring's force moves the sheet once a substep. Right in steps that are short enough."""

import math
from collections.abc import Callable

import taichi as ti

from sim.cloth.board import LANES
from sim.cloth.damping import Damped
from sim.cloth.forces import SpringForces
from sim.cloth.spectrum import top_frequency
from sim.cloth.xpbd import SETTLED_SPEED, Xpbd
from sim.model import quantity
from sim.registry import register
from sim.stage import Build, Limit, Suspect

MARGIN = 0.9
"""[1] Of the limit that is taken where a scene leaves the substep open: springs that turn and stretch vary theirs."""
LIMITED = 0.5
"""[1] Of explicit Euler's limit, where a strain limit is on: what that adds to velocities shows a substep late, and the
threads' damping answers it late once more. Measured on a sheet at 30 g: 0.5 holds, 0.7 does not."""
OVERSTEP = 1.01
"""[1] times the limit. It is the very edge, not a rule of thumb."""


class Forced(Xpbd):
    """What both have: springs as forces of the places and velocities at the substep's start.

    Clips, guests, contact with solids, tethers, damping and settling as `xpbd` has them; the strain limit by one sweep
    a substep that only shortens (Provot 1995).
    bound(tau, omega): of each, the longest stable substep of a sheet whose fastest swing is omega [rad/s]; 0 s where
    none is.
    """

    elastic = 0.0
    bound: Callable[[float, float], Limit]

    def __init__(self, build: Build, params):
        super().__init__(build, params)
        self.forces = SpringForces(self.sheet.families, self.board)
        self.retardation = ti.field(self.board.real, ())
        self.retardation[None] = params.retardation
        self.leading = [ti.field(self.board.real, self.board.half) for _ in range(3)]
        self.frequency = top_frequency(self.sheet)
        self.settling = False
        self.longest = 0.0

    def substep_max(self) -> float:
        """cloth.METHOD.substep_max, within the limit where limits are obeyed [s]."""
        asked = self.params.substep_max or math.inf
        if self.obeys or self._calmed():
            asked = min(asked, MARGIN * self._stable())
        return asked

    def settle(self, seconds: float, still: float = SETTLED_SPEED, evenly: bool = False) -> None:
        """See Xpbd; with threads damped (zeta = 1/2 at the fastest swing), or what they store rings for seconds."""
        self.settling = True
        self.retardation[None] = self._tau()
        super().settle(seconds, still, evenly)
        self.settling = False
        self.retardation[None] = self._tau()

    def _tau(self) -> float:
        """Retardation time in force [s]."""
        return max(self.params.retardation, 1.0 / self.frequency if self._calmed() else 0.0)

    def _calmed(self) -> bool:
        """Whether it is settling, and in substeps of its own choice."""
        return self.settling and (self.obeys or not self.params.substep_max)

    def limit(self) -> Limit:
        """That of this sheet."""
        return self.bound(self._tau(), self.frequency)

    def _stable(self) -> float:
        """A substep to take [s]."""
        return self.limit().seconds

    def advance(self, dt: float, damping: float, drag: float, brake: float = 0.0) -> None:
        """See Xpbd; notes the longest substep for the guard."""
        self.longest = max(self.longest, dt / max(1, math.ceil(dt / self.substep_max() - 1e-9)))
        super().advance(dt, damping, drag, brake)

    def suspects(self) -> tuple[Suspect, ...]:
        """A substep beyond the limit."""
        limit = self.limit()
        if self.longest <= OVERSTEP * limit.seconds:
            return ()
        words = (
            f"cloth substeps of {1e3 * self.longest:.3g} ms are {self.longest / limit.seconds:.3g} x the {limit.name} "
            f"limit of {1e3 * limit.seconds:.3g} ms, set run.dt_limits = true or lower cloth.{self.name}.substep_max"
        )
        return (Suspect("exploding", words),)

    @ti.func
    def _sum_forces(self):
        """pull = force of springs and bending at the substep's start."""
        for i in range(self.board.ni):
            self._clear(i)
        retardation = self.retardation[None]
        self.forces.add(self.pull, self.board.start, retardation)
        if ti.static(self.bending.present):
            for block in range(self.board.half // LANES):
                at = block * LANES
                for d in ti.static(range(3)):
                    x, v = self.board.get(self.board.start[d], at), self.board.get(self.board.v[d], at)
                    self.board.put(self.leading[d], at, x + retardation * v)
            self.bending.add(self.pull, self.leading, 1.0)


class ForcedParams(Damped):
    """What both read."""

    substep_max: float | None = quantity(None, "time", ge=1e-9, why="absent = as long as is stable")
    retardation: float = quantity("0 s", "time", ge=0, why="of the threads: tension k (dl + tau dl/dt); 0 = none")


@register("cloth.solver", "symplectic_euler")
@ti.data_oriented
class SymplecticEuler(Forced):
    """v += h a(x, v), x += h v: stable for h < (2/omega)(sqrt(1 + zeta^2) - zeta), zeta = tau omega/2.   Order 1."""

    class Params(ForcedParams):
        """[cloth.symplectic_euler]"""

    @staticmethod
    def bound(tau: float, omega: float) -> Limit:
        """(2/omega)(sqrt(1 + zeta^2) - zeta), zeta = tau omega/2: damping is taken at the velocity before."""
        zeta = 0.5 * tau * omega
        return Limit(2.0 / omega * (math.sqrt(1.0 + zeta**2) - zeta), "symplectic Euler")

    @ti.func
    def _resist(self, h):
        self._sum_forces()
        for i in range(self.board.ni):
            self._kick(i, i, h * h)


@register("cloth.solver", "explicit_euler")
@ti.data_oriented
class ExplicitEuler(Forced):
    """x += h v, v += h a(x, v), both from before (the 2019 report's): fails at every h unless threads are damped.

    With a retardation time tau it is stable for h < tau, and h < 2/(omega (zeta + sqrt(zeta^2 - 1))) where zeta > 1.
    """

    class Params(ForcedParams):
        """[cloth.explicit_euler]"""

    def __init__(self, build: Build, params):
        super().__init__(build, params)
        self.lagged = ti.field(self.board.real, ())
        self.lagged[None] = 1.0

    def limit(self) -> Limit:
        """That of this sheet; LIMITED of it under a strain limit."""
        own = super().limit()
        return Limit(LIMITED * own.seconds, f"{own.name} (under a strain limit)") if self.sweep.limited else own

    @staticmethod
    def bound(tau: float, omega: float) -> Limit:
        """Modes with zeta = tau omega/2 < 1 need h < tau, the stiffest of the others 2 over its faster rate."""
        zeta = 0.5 * tau * omega
        fast = 2.0 / (omega * (zeta + math.sqrt(zeta**2 - 1.0))) if zeta > 1.0 else math.inf
        return Limit(min(tau, fast), "explicit Euler")

    def _stable(self) -> float:
        """Hanging at rest goes by the symplectic rule; without damping no step is stable, and that one is as good."""
        own = self.limit().seconds
        return own if own and not self.settling else SymplecticEuler.bound(self._tau(), self.frequency).seconds

    def suspects(self) -> tuple[Suspect, ...]:
        """No damping, or a substep beyond the limit."""
        if self.params.retardation > 0.0:
            return super().suspects()
        words = (
            "explicit Euler without damping gains energy at every dt, set cloth.explicit_euler.retardation or "
            "cloth.method = symplectic_euler"
        )
        return (Suspect("exploding", words),)

    def settle(self, seconds: float, still: float = SETTLED_SPEED, evenly: bool = False) -> None:
        """By the symplectic rule: at rest the two agree."""
        self.lagged[None] = 0.0
        super().settle(seconds, still, evenly)
        self.lagged[None] = 1.0

    @ti.func
    def _resist(self, h):
        """The place keeps what the old velocity gives it; what forces add shows in start, from which v is read."""
        self._sum_forces()
        for i in range(self.board.ni):
            self._kick(i, i, h * h)
        for block in range(self.board.half // LANES):
            at = block * LANES
            for d in ti.static(range(3)):
                x, start = self.board.get(self.board.x[d], at), self.board.get(self.board.start[d], at)
                v = self.board.get(self.board.v[d], at)
                gain = self.lagged[None] * (x - start - h * v)
                self.board.put(self.board.x[d], at, x - gain)
                self.board.put(self.board.start[d], at, start - gain)
