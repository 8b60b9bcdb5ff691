"""Round streams from nozzles: which particle has come by a time, and where it then is, from the time alone."""

import numpy as np
import taichi as ti

from sim.scene.water import Water

JITTER = 0.05
"""Sideways displacement of each particle, in spacings: breaks the lattice. 0.1 would raise the density by 2.5 %."""
FEMTOSECOND = 1e-15
"""[s]"""
ENDLESS = 2**62
"""Period of a stream that does not repeat."""


@ti.data_oriented
class Streams:
    """Every emitter of the scene as tables. Particle p of stream s belongs to layer p // n of its round."""

    def __init__(self, water: Water, seed: int, spacing: float):
        streams = water.streams
        self.count = len(streams)
        self.seed = seed % 2**31
        self.jitter = JITTER * spacing
        rows = max(self.count, 1)
        self.clock = ti.field(ti.i64, shape=(rows, 4))  # start, interval, total, period
        self.disc = ti.field(ti.i32, shape=(rows, 2))  # first point, number of points
        self.velocity = ti.Vector.field(3, float, shape=rows)
        self.points = ti.Vector.field(3, float, shape=max(sum(len(s.points) for s in streams), 1))
        if streams:
            clocks = [(s.start, s.interval, s.total, s.period or ENDLESS) for s in streams]
            counts = np.array([len(s.points) for s in streams])
            self.clock.from_numpy(np.array(clocks, np.int64))
            self.disc.from_numpy(np.stack([np.cumsum(counts) - counts, counts], 1).astype(np.int32))
            self.velocity.from_numpy(np.array([s.velocity for s in streams]))
            self.points.from_numpy(np.concatenate([s.points for s in streams]))

    @ti.func
    def due(self, s, time) -> ti.i64:
        """Particles of stream s that have come by `time` [fs]."""
        start, interval, total, period = self.clock[s, 0], self.clock[s, 1], self.clock[s, 2], self.clock[s, 3]
        come = ti.i64(0)
        if time >= 0:
            rounds = time // period
            since = time - rounds * period - start
            if since >= 0:
                come = ti.min(total, (since // interval + 1) * self.disc[s, 1])
            come += rounds * total
        return come

    @ti.func
    def particle(self, s, p, time):
        """(x, v) of particle p of stream s at `time` [fs]: it left the nozzle on time and flew straight since."""
        rounds = p // self.clock[s, 2]
        q = p - rounds * self.clock[s, 2]
        layer = q // self.disc[s, 1]
        left = rounds * self.clock[s, 3] + self.clock[s, 0] + layer * self.clock[s, 1]
        age = ti.cast(ti.cast(time - left, ti.f64) * FEMTOSECOND, float)
        v = self.velocity[s]
        side = ti.Vector([self._hash(s, p, 0), self._hash(s, p, 1), self._hash(s, p, 2)]) * self.jitter
        side -= v * (side.dot(v) / v.norm_sqr())
        lane = self.disc[s, 0] + ti.cast(q - layer * self.disc[s, 1], ti.i32)
        return self.points[lane] + side + v * age, v

    @ti.func
    def _hash(self, s, p, axis):
        """A number in [-1, 1) from a counter, the same on every machine and after every restart (PCG, O'Neill 2014)."""
        state = ti.cast(p * 3 + axis, ti.u32) * ti.u32(747796405) + ti.cast(self.seed + 7919 * s, ti.u32)
        for _ in ti.static(range(2)):
            state = state * ti.u32(747796405) + ti.u32(2891336453)
            state = ((state >> ((state >> 28) + 4)) ^ state) * ti.u32(277803737)
            state = (state >> 22) ^ state
        return ti.cast(state >> 8, float) / 8388608.0 - 1.0
