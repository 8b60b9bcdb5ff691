"""Clips that carry the sheet along their paths, wait while it is taut, and give way to a pull that is too strong."""

import numpy as np
import taichi as ti

from sim.scene.cloth import spring_list
from sim.scene.grips import build_grips
from sim.stage import Build, Stage
from sim.state import Row

EASE, HOLD = 1.015, 1.035
"""[strain limit] Clips slow down from the one on and stand still at the other. A spring at a clip's corner is at the
limit long before the sheet is, and its load goes to the next; beyond the limit are springs that sweeps cannot hold."""
HASTE = 0.2
"""[m/s] A clip under no load, or under twice its force, comes or goes as fast; in between by the difference."""


@ti.data_oriented
class Clips:
    """Gives held nodes the velocity that takes them to their place on the path at the step's end.

    Without a strain limit the path's time is the scene's. With one it stands still while a spring is stretched to HOLD
    times the limit: a clip that goes its way whatever it pulls beats any limit. A clip of limited force stands off its
    place by what it has given way along the pull F of its springs, at HASTE (|F|/force - 1), and comes back likewise.
    """

    rows = ("cloth.x", "cloth.v")
    scratch = (
        Row("cloth.clips.time", "f", "s", "how far along their paths clips are, in the first entry"),
        Row("cloth.clips.give", "v", "m", "how far clips have given way, an entry each"),
    )

    @staticmethod
    def wanted(config) -> bool:
        """Whether any clip has a path."""
        return any(pin.path for pin in config.cloth.pins.values())

    def __init__(self, build: Build):
        self.parts, self.limit = build.parts, build.config.cloth.strain_limit
        self.grips = build_grips(build.config.cloth, build.scene.sheet)
        nodes = np.concatenate([grip.nodes for grip in self.grips])
        self.x, self.v = (build.state[n] for n in self.rows)
        self.time, self.give = (build.state[row.name] for row in self.scratch)
        self.limited = [n for n, grip in enumerate(self.grips) if grip.force is not None]
        self.springs = spring_list(build.scene.sheet)
        self.pulled = [self._springs_of(grip) for grip in self.grips]
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
        places = [grip.place(now) for grip in self.grips]
        if self.limited:
            self.given = self.give.to_numpy()
            self._yield(dt)
            places = [place + given for place, given in zip(places, self.give.to_numpy())]
        self._aim(np.concatenate(places).astype(self.real), dt)

    def forget(self, dt: float) -> None:
        """Back to where they were on their paths."""
        self.time[0] = self.began
        if self.limited:
            self.give.from_numpy(self.given)

    def _springs_of(self, grip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(held and free node (s, 2), rest (s,), stiffness (s,)) of the springs between a grip and the sheet."""
        held = np.isin(self.springs.ends, grip.nodes)
        some = held.any(1) & ~held.all(1)
        ends = np.where(held[some][:, :1], self.springs.ends[some], self.springs.ends[some][:, ::-1])
        return ends, self.springs.rest[some], self.springs.stiffness[some]

    def pull(self, n: int, x: np.ndarray) -> np.ndarray:
        """Force of the springs on clip n [N], of nodes at x [m]; on one that turns, what of it is along its axis."""
        (ends, rest, stiffness), along = self.pulled[n], self.grips[n].along
        d = x[ends[:, 1]] - x[ends[:, 0]]
        pull = ((stiffness * (1.0 - rest / np.linalg.norm(d, axis=1)))[:, None] * d).sum(0)
        return pull if along is None else pull.dot(along) * along

    def _yield(self, dt: float) -> None:
        """Clips of limited force give way, or come back."""
        x = self.x.to_numpy().astype(np.float64)
        for n in self.limited:
            pull, given = self.pull(n, x), np.array(self.give[n], np.float64)
            excess = min(float(np.linalg.norm(pull)) / self.grips[n].force - 1.0, 1.0)
            toward = pull if excess > 0.0 else -given
            far, step = max(float(np.linalg.norm(toward)), 1e-12), HASTE * abs(excess) * dt
            self.give[n] = given + (step if excess > 0.0 else min(step, far)) / far * toward

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
