"""The step taken: the smallest of every stage's limit, laid evenly into what is left of the frame."""

import math
from typing import Iterable, NamedTuple

from sim.errors import DivergedError
from sim.stage import Limit, Stage

OVERSTEP = 1.1
"""[1] times a limit. Limits lie two to five times under the edge; less than this is none of a failure's causes."""


class Overstep(NamedTuple):
    """A step longer than a limit allows: when [s], how long [s], and the limit."""

    time: float
    dt: float
    limit: Limit

    def __str__(self) -> str:
        ratio = self.dt / self.limit.seconds if self.limit.seconds else math.inf
        return (
            f"since t = {self.time:.4g} s dt = {1e3 * self.dt:.3g} ms is {ratio:.2g} x the {self.limit.name} limit of "
            f"{1e3 * self.limit.seconds:.2g} ms, set run.dt_limits = true"
        )


class Clock:
    """Time stands at frame / fps plus an f64 remainder; a step never crosses a frame.

    frame, elapsed [s] since it, step (of the run), bound (the Limit of the last step) are all there is to it, and of
    a run that ignores its limits (obeys = False) the first Overstep.
    """

    def __init__(self, fps: int, dt_max: float, dt_min: float, obeys: bool = True):
        self.fps, self.cap, self.dt_min, self.obeys = fps, Limit(dt_max, "run.dt_max"), dt_min, obeys
        self.frame, self.elapsed, self.step = 0, 0.0, 0
        self.bound, self.overstep = self.cap, None

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.frame / self.fps + self.elapsed

    def next_step(self, stages: Iterable[Stage]) -> float:
        """dt [s]. What is left of the frame is split evenly: a last sliver of 2 us made 10 m/s.

        Raises DivergedError ("starving") below dt_min.
        """
        limit = min((stage.limit() for stage in stages if stage.limit), default=self.cap)
        self.bound = min(limit, self.cap) if self.obeys else self.cap
        seconds = self.bound.seconds
        if not seconds >= self.dt_min:
            raise DivergedError(
                f"starving at t = {self.time:.4g} s: the {self.bound.name} limit asks for steps of {seconds:.2g} s, "
                f"under run.dt_min = {self.dt_min:g} s; use a larger spacing or slower water"
            )
        left = 1.0 / self.fps - self.elapsed
        dt = left / max(1, math.ceil(left / seconds - 1e-6))
        if self.overstep is None and dt > OVERSTEP * limit.seconds:
            self.overstep = Overstep(self.time, dt, limit)
        return dt

    def advance(self, dt: float) -> bool:
        """Book a step of dt; True when it ended the frame."""
        self.step += 1
        self.elapsed += dt
        if self.elapsed < (1.0 - 1e-9) / self.fps:
            return False
        self.frame, self.elapsed = self.frame + 1, 0.0
        return True
