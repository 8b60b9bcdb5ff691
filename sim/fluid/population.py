"""Particles come (streams, drips), and go (drains, the end of space, soaking in), in whole units of mass."""

import numpy as np
import taichi as ti

from sim import runtime
from sim.constants import MASS_UNIT
from sim.errors import CapacityError
from sim.fluid.streams import Streams
from sim.scene.water import FEMTO
from sim.stage import Build, Stage
from sim.state import Row


@ti.data_oriented
class Population:
    """Who is there: build.parts["population"].

    set_units(i, units)       ti.func: mass of a particle [MASS_UNIT]; 0 removes it at the next source slot
    append(x, v, units) -> i  ti.func: a new particle with the next id; only from serial loops, whose order is fixed.
                              -1 where there is no room; the source slot then raises CapacityError
    reset()                   the water of the scene at t = 0
    emitted_units(), drained_units()   for the ledger [MASS_UNIT]
    """

    rows = ("fluid.id", "fluid.x", "fluid.v", "fluid.mass", "fluid.mass_units")
    scratch = (
        Row("fluid.order", "i", "1", "old row of each new row", saved=False),
        Row("scene.population.time", "m", "fs", "since the start, as the streams count it"),
        Row("scene.population.poured", "m", "fs", "until when the streams have been poured"),
        Row("scene.population.next_id", "i", "1", "of the next particle"),
        Row("scene.population.emitted", "m", "1e-15 kg", "blocks and streams so far"),
        Row("scene.population.drained", "m", "1e-15 kg", "swallowed by drains or gone from space"),
        Row("scene.population.refused", "i", "1", "appends without room"),
    )

    def __init__(self, build: Build):
        self.build = build
        self.state, self.water = build.state, build.scene.water
        self.id, self.x, self.v, self.mass, self.units = (build.state[name] for name in self.rows)
        self.order, self.time, self.poured, self.next_id, self.emitted, self.drained, self.refused = (
            build.state[row.name] for row in self.scratch
        )
        others = [r for r in self.state.rows.values() if r.saved and r.name[:6] == "fluid." and r.name not in self.rows]
        self.numbers = [self.state[r.name] for r in others if r.dtype != "v"]
        self.vectors = [self.state[r.name] for r in others if r.dtype == "v"]
        self.capacity = build.state.sizes["fluid"]
        self.streams = Streams(self.water, build.config.run.seed, build.config.fluid.spacing)
        self.low = ti.Vector([float(a) for a in build.config.space.low])
        self.high = ti.Vector([float(a) for a in build.config.space.high])
        for a in ("xyz".index(a) for a in build.config.space.periodic):
            self.low[a], self.high[a] = -float("inf"), float("inf")
        self.few = runtime.few(self.capacity)
        build.parts["population"] = self

    def stages(self) -> tuple[Stage, ...]:
        """Removal, then emission."""
        return (Stage("source", "source", self.run, self.state.moving, self.state.moving, forget=self.forget),)

    def run(self, dt: float) -> None:
        """Take out what left or died, pour what has come by now. CapacityError if someone found no room."""
        if self._leave():
            self._pack()
            self.state.permute_fluid(self.order)
        if self._pour(round(dt * FEMTO)):
            raise CapacityError(f"fluid.particles_max = {self.capacity}: full; raise it")

    def forget(self, dt: float) -> None:
        """What a step of dt that was taken back poured stays; the next ones count on from its start."""
        self.time[0] -= round(dt * FEMTO)

    def reset(self) -> None:
        """The scene's blocks at t = 0, ids in order; nothing has come or gone yet."""
        count = len(self.water.x)
        for row in self.scratch:
            self.state[row.name].fill(0)
        self.poured[0] = -1
        self.next_id[0] = count
        self.emitted[0] = count * self.water.units
        for field, values in ((self.x, self.water.x), (self.v, self.water.v)):
            field.from_numpy(_padded(values, self.capacity))
        self.id.from_numpy(np.arange(max(self.capacity, 1), dtype=np.int32))
        alive = np.arange(max(self.capacity, 1)) < count
        self.units.from_numpy(alive * np.int64(self.water.units))
        self.mass.from_numpy(alive * (self.water.units * MASS_UNIT))
        self.state.count[None] = count

    def emitted_units(self) -> int:
        """Mass of the blocks and of all that the streams have poured."""
        return int(self.emitted[0])

    def drained_units(self) -> int:
        """Mass that drains swallowed, or that left space."""
        return int(self.drained[0])

    @ti.func
    def set_units(self, i, units):
        """Mass of particle i, in whole units and, derived, in kg."""
        self.units[i] = units
        self.mass[i] = ti.cast(ti.cast(units, ti.f64) * MASS_UNIT, float)

    @ti.func
    def append(self, x, v, units) -> ti.i32:
        """A new particle at the end of the rows; its row, or -1 if there is no room."""
        i = self.state.count[None]
        if i < self.capacity:
            self.state.count[None] = i + 1
            self.id[i] = self.next_id[0]
            self.next_id[0] += 1
            self.x[i], self.v[i] = x, v
            self.set_units(i, units)
            self._blank(i)
        else:
            self.refused[0] += 1
            i = -1
        return i

    @ti.func
    def _blank(self, i):
        """What other methods keep for a particle (warm pressures, say) starts at 0."""
        for number in ti.static(self.numbers):
            number[i] = 0
        for vector in ti.static(self.vectors):
            vector[i] = ti.Vector([0.0, 0.0, 0.0])

    @ti.func
    def _gone(self, x) -> ti.i32:
        """Whether x is outside of space (along periodic axes nothing is) or in a drain.

        A NaN is neither, so the guard gets to see it.
        """
        gone = ti.cast((x < self.low).any() | (x > self.high).any(), ti.i32)
        for low, high in ti.static(self.water.drains):
            gone |= ti.cast((x > ti.Vector(low)).all() & (x < ti.Vector(high)).all(), ti.i32)
        return gone

    @ti.kernel
    def _leave(self) -> ti.i32:
        """Book what left as drained; returns how many rows are dead."""
        dead = 0
        ti.loop_config(serialize=self.few)
        for i in range(self.state.count[None]):
            if self._gone(self.x[i]):
                ti.atomic_add(self.drained[0], self.units[i])
                self.set_units(i, ti.i64(0))
            if self.units[i] == 0:
                dead += 1
        return dead

    @ti.kernel
    def _pack(self):
        """The living rows in their order, and their number."""
        living = 0
        ti.loop_config(serialize=True)
        for i in range(self.state.count[None]):
            if self.units[i] != 0:
                self.order[living] = i
                living += 1
        self.state.count[None] = living

    @ti.kernel
    def _pour(self, dt_fs: ti.i64) -> ti.i32:
        """Emit what came since the step before; returns how many appends found no room so far."""
        units = ti.i64(ti.static(self.water.units))
        ti.loop_config(serialize=True)
        for s in range(self.streams.count):
            p = self.streams.due(s, self.poured[0])
            while p < self.streams.due(s, self.time[0]):
                x, v = self.streams.particle(s, p, self.time[0])
                if self.append(x, v, units) >= 0:
                    self.emitted[0] += units
                p += 1
        self.poured[0] = self.time[0]
        self.time[0] += dt_fs
        return self.refused[0]


def _padded(values: np.ndarray, capacity: int) -> np.ndarray:
    whole = np.zeros((max(capacity, 1), 3))
    whole[: len(values)] = values
    return whole
