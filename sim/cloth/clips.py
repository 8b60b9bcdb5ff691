"""Clips that carry the sheet along their paths, and wait while it is taut."""

import numpy as np
import taichi as ti

from sim.scene.grips import build_grips
from sim.stage import Build, Stage
from sim.state import Row

EASE, HOLD = 0.85, 0.98
"""[strain limit] Clips slow down from the one on and stand still at the other: a hand that turns a towel feels it."""


@ti.data_oriented
class Clips:
    """Gives held nodes the velocity that takes them to their place on the path at the step's end.

    Without a strain limit the path's time is the scene's. With one it stands still while a spring is stretched to HOLD
    of the limit: a clip that goes its way whatever it pulls beats any limit.
    """

    rows = ("cloth.x", "cloth.v")
    scratch = (Row("cloth.clips.time", "f", "s", "how far along their paths clips are, in the first entry"),)

    @staticmethod
    def wanted(config) -> bool:
        """Whether any clip has a path."""
        return any(pin.path for pin in config.cloth.pins.values())

    def __init__(self, build: Build):
        self.parts, self.limit = build.parts, build.config.cloth.strain_limit
        self.grips = build_grips(build.config.cloth, build.scene.sheet)
        nodes = np.concatenate([grip.nodes for grip in self.grips])
        self.x, self.v, self.time = (build.state[n] for n in (*self.rows, self.scratch[0].name))
        self.nodes = ti.field(ti.i32, len(nodes))
        self.nodes.from_numpy(nodes.astype(np.int32))
        self.real = np.float64 if self.time.dtype == ti.f64 else np.float32
        build.parts["clips"] = self

    def stages(self) -> tuple[Stage, ...]:
        """One, before the sheet moves."""
        reads = ("cloth.x", "cloth.v")
        return (Stage("clips", "accelerate", self.run, reads=reads, writes=("cloth.v",), forget=self.forget),)

    def run(self, dt: float) -> None:
        """Where they shall be, and how fast they must go."""
        self.began = float(self.time[0])
        self.time[0] += dt * self._pace()
        now = float(self.time[0])
        places = np.concatenate([grip.place(now) for grip in self.grips]).astype(self.real)
        self._aim(places, dt)

    def forget(self, dt: float) -> None:
        """Back to where they were on their paths."""
        self.time[0] = self.began

    def _pace(self) -> float:
        """1 along the path while the sheet is slack, 0 while it is taut."""
        if self.limit is None:
            return 1.0
        strain = self.parts["cloth"].max_strain() / self.limit
        return float(np.clip((HOLD - strain) / (HOLD - EASE), 0.0, 1.0))

    @ti.kernel
    def _aim(self, places: ti.types.ndarray(), dt: float):
        ti.loop_config(serialize=True)
        for s in range(self.nodes.shape[0]):
            n = self.nodes[s]
            there = ti.Vector([places[s, 0], places[s, 1], places[s, 2]])
            self.v[n] = (there - self.x[n]) / dt
