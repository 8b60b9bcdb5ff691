"""XPBD in small steps: many substeps of one sweep each, all in one serial kernel."""

import math

import taichi as ti
import taichi.math as tm

from sim.bodies import Bodies
from sim.cloth.board import LANES, Board
from sim.cloth.contact import SolidContact
from sim.cloth.damping import Damped, damp_bending, damp_relative, largest_speed
from sim.cloth.isometric import RING, Isometric
from sim.cloth.measure import Measure
from sim.cloth.spectrum import top_frequency
from sim.cloth.strain_limit import Tethers
from sim.cloth.sweep import CLEARING, Sweep
from sim.model import quantity
from sim.registry import register
from sim.stage import Build, Stage, Suspect

SETTLE_STEP = 0.02
"""[s] Between two looks at whether the sheet is at rest, and two brakings; less costs kernel calls."""
SETTLE_DRAG = 20.0
"""[1/s] Near critical for the slowest swing of a sheet sagging 5 cm, sqrt(g/sag) = 14 1/s: more creeps, less swings."""
SETTLED_SPEED = 1e-4
"""[m/s] rms of a sheet at rest; a pixel of a 20 cm picture is passed in 2 s."""


@register("cloth.solver", "xpbd")
@ti.data_oriented
class Xpbd:
    """x* = x + h v + h^2 g, one sweep of C = |d| - L with compliance 1/k, v = (x - x_start)/h.   Macklin 2016, 2019

    Reads and writes cloth.x [m], cloth.v [m/s]; reads cloth.mass [kg], cloth.inv_mass [1/kg] at each step's start,
    so they may change between steps; gravity does not depend on them, nor do the springs.

    Guests, from build.parts["guests"], take part in every substep. Each names the rows it `reads` and `writes`, and
    has begin(dt), end(dt), called from Python around the kernel, and the @ti.func methods predict(h), project(h) and
    finish(h), called after the sheet's own prediction, after its springs and contacts, and after its velocities are
    known. They see and move the sheet by the funcs below: position, velocity, weight, shift, push, of a node at its
    place on the board (see sim.cloth.board.place_of).
    """

    class Params(Damped):
        """[cloth.xpbd]"""

        substep_max: float = quantity(
            "0.1 ms", "time", ge=1e-9, why="dry cotton on 5 mm: 1.6 x too soft, at 0.05 ms 1.04 x"
        )

    rows = ("cloth.x", "cloth.v", "cloth.mass", "cloth.inv_mass")
    scratch = ()
    elastic = 1.0
    """1.0: springs are constraints, corrected by sweeps; 0.0: forces, and sweeps hold the strain limit alone."""

    def __init__(self, build: Build, params: Params):
        sheet, cloth = build.scene.sheet, build.config.cloth
        self.params, self.sheet = params, sheet
        self.node_count = len(sheet.x)
        self.gravity = tuple(build.config.space.gravity)
        self.x, self.v = build.state["cloth.x"], build.state["cloth.v"]
        self.mass, self.inv_mass = build.state["cloth.mass"], build.state["cloth.inv_mass"]
        self.board = Board(sheet.shape)
        self.sweep = Sweep(sheet.families, self.board, cloth.strain_limit)
        self.sweeps = self.elastic > 0.0 or self.sweep.limited
        self.bending = Isometric(sheet, self.board)
        self.pull = [ti.field(self.board.real, self.board.half) for _ in range(3)]
        self.tethers = Tethers(sheet, self.board, cloth.strain_limit)
        self.contact = SolidContact(
            Bodies.of(build), sheet.thickness, self.board, sheet.spacing, "self_contact" in build.parts
        )
        bend = top_frequency(sheet, springs=False) if self.bending.present else 0.0
        self.whole_bend = 1.0 / bend if bend else math.inf
        self.bend_within = ti.field(self.board.real, ())
        self.bend_within[None] = self.whole_bend
        stiffness = cloth.fabric.bending if cloth.bending != "none" else 0.0
        self.bending_viscosity = stiffness * params.bending_retardation / sheet.spacing**2
        self.bends_slowly = self.bending_viscosity > 0.0
        self.obeys = build.config.run.dt_limits
        self.measure = Measure(sheet, self.x, self.v, self.mass)
        self.clips_move = "clips" in build.parts
        self.guests = build.parts.setdefault("guests", [])
        self.self_contact = build.parts.get("self_contact")
        self.step_limit = getattr(self.self_contact, "limit", None)
        self.step_max = build.config.run.dt_max if self.self_contact else math.inf
        self.simulated, self.substeps = 0.0, 0

    def stages(self) -> tuple[Stage, ...]:
        """One: the sheet, and what touches it, over dt."""
        reads = self.rows + tuple(name for guest in self.guests for name in guest.reads)
        writes = ("cloth.x", "cloth.v") + tuple(name for guest in self.guests for name in guest.writes)
        return (Stage(f"cloth.{self.name}", "cloth", self.run, reads, writes, self.step_limit),)

    def run(self, dt: float) -> None:
        """dt seconds in ceil(dt/substep_max) equal substeps."""
        for guest in self.guests:
            guest.begin(dt)
        self.advance(dt, self.params.damping, self.params.drag)
        for guest in self.guests:
            guest.end(dt)

    def advance(self, dt: float, damping: float, drag: float, brake: float = 0.0) -> None:
        """The step itself. damping [1/s]: of motion that is not rigid; drag [1/s]: of all motion.

        brake [1/s]: the same at the end of dt, not in each substep, so that a sheet that springs up as it settles falls
        back through its dome.
        """
        count = max(1, math.ceil(dt / self.substep_max() - 1e-9))
        self.simulated, self.substeps = self.simulated + dt, self.substeps + count
        kept, left = math.exp(-damping * dt), math.exp(-drag * dt / count)
        viscosity = self.bending_viscosity * dt
        self._advance(count, dt / count, tm.vec3(self.gravity), kept, left, viscosity, math.exp(-brake * dt))

    def substep_max(self) -> float:
        """cloth.METHOD.substep_max, and no longer than bending can be taken in whole [s]."""
        return min(self.params.substep_max, self.whole_bend if self.obeys else math.inf)

    def suspects(self) -> tuple[Suspect, ...]:
        """Settings known to fail, for the guard: none, for no step is too long to be stable."""
        return ()

    def settle(self, seconds: float, still: float = SETTLED_SPEED, evenly: bool = False) -> None:
        """Hang under strong drag, water or not, for `seconds` or until at rest (`still`, rms); end without speed.

        Self contact takes part where the scene models it; other guests do not: wind and water begin with time.
        evenly: drag in each substep, which comes to rest closer, but may leave a sheet hanging in its own dome.
        """
        even, brake = (SETTLE_DRAG, 0.0) if evenly else (self.params.drag, SETTLE_DRAG)
        rest = 0.5 * float(self.sheet.mass.sum()) * still**2
        for _ in range(math.ceil(seconds / SETTLE_STEP - 1e-9)):
            self._settle_step(even, brake)
            if not self.kinetic_energy() >= rest:  # or no number any more, which is for others to tell
                break
        self.v.fill(0.0)

    def _settle_step(self, drag: float, brake: float) -> None:
        """SETTLE_STEP at once, or in steps that self contact can follow; braked at its end."""
        contact, left = self.self_contact, SETTLE_STEP
        while left > 0.0:
            dt = left
            if contact:
                limit = self.step_limit().seconds if self.step_limit else math.inf
                dt = left / math.ceil(left / min(limit, self.step_max) - 1e-9)
                contact.begin(dt)
            last = dt == left
            self.advance(dt, self.params.damping, drag, brake * SETTLE_STEP / dt if last else 0.0)
            if contact:
                contact.end(dt)
            left = 0.0 if last else left - dt

    def max_strain(self) -> float:
        """max over structural and shear springs of length/rest - 1."""
        return self.measure.max_strain()

    def kinetic_energy(self) -> float:
        """sum m v^2/2 [J]."""
        return self.measure.kinetic_energy()

    @ti.func
    def position(self, at):
        """Where the node at that place is now, within the substep [m]."""
        return self.board.vector(self.board.x, at)

    @ti.func
    def velocity(self, at):
        """In `predict` and `project` that of the last substep, in `finish` that of this one [m/s]."""
        return self.board.vector(self.board.v, at)

    @ti.func
    def weight(self, at):
        """Inverse mass, 0 where a clip holds [1/kg]."""
        return self.board.w[at]

    @ti.func
    def shift(self, at, offset):
        """Move a node by offset [m] in `project`: an impulse of offset/(h weight). Leave held nodes alone."""
        self.board.set_vector(self.board.x, at, self.board.vector(self.board.x, at) + offset)

    @ti.func
    def push(self, at, change):
        """Change a node's velocity [m/s] in `finish`. Leave held nodes alone."""
        self.board.set_vector(self.board.v, at, self.board.vector(self.board.v, at) + change)

    @ti.kernel
    def _advance(
        self, count: ti.i32, h: float, gravity: tm.vec3, kept: float, left: float, viscosity: float, slowed: float
    ):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self._load(count * h, gravity)
            for step in range(count + CLEARING):  # one sweep in the code, for it is dear to compile
                elastic = self.elastic if step < count else 0.0
                if step < count:
                    self._set_out(h, gravity, left, step)
                if ti.static(self.sweeps):
                    if step < count or self.sweep.wanted(step - count):
                        self.sweep.run(h, elastic)
                if step < count:
                    self.tethers.project()
                    self.contact.project(h, (step + 1) * h)
                    for guest in ti.static(self.guests):
                        guest.project(h)
                    if not ti.static(self._alone()) or step == count - 1:
                        self._finish(h, left)
                    for guest in ti.static(self.guests):
                        guest.finish(h)
            if kept < 1.0:
                damp_relative(self.board, kept)
            if ti.static(self.bends_slowly):
                damp_bending(self.board, viscosity)
            self._store(slowed)

    @ti.func
    def _load(self, dt, gravity):
        """Rows to the board, and which solids are in reach."""
        self.board.clear()
        low, high = self.x[0], self.x[0]
        for node in range(self.node_count):
            at = self.board.place(node)
            self.board.set_vector(self.board.x, at, self.x[node])
            self.board.w[at] = self.inv_mass[node]
            self.board.set_vector(self.board.v, at, self.v[node] * (self.inv_mass[node] > 0.0 or self.clips_move))
            low, high = ti.min(low, self.x[node]), ti.max(high, self.x[node])
        self.tethers.begin()
        reach = 2.0 * dt * (largest_speed(self.board) + dt * gravity.norm()) + self.sheet.spacing
        self.contact.mark(low - reach, high + reach, dt)

    def _alone(self) -> bool:
        """Whether nobody looks on between two substeps, so that a row may go into the next while it is in the cache."""
        return not self.guests and self.elastic > 0.0 and self.bending.present

    @ti.func
    def _set_out(self, h, gravity, left, step):
        """Prediction, guests, bending. Alone, row by row, and velocities from the substep before on the way."""
        if ti.static(self._alone()):
            within = self._bent(h)
            for front in range(self.board.ni + 2):
                if front < self.board.ni:
                    if step > 0:
                        self._slow(front, h, left)
                    self._predict(front, h, gravity)
                    self._clear(front & (RING - 1))
                if front >= 2:
                    self.bending.add_row(self.pull, self.board.x, within, front - 2, RING - 1)
                    self._kick(front - 2, (front - 2) & (RING - 1), h * h)
        else:
            for i in range(self.board.ni):
                self._predict(i, h, gravity)
            for guest in ti.static(self.guests):
                guest.predict(h)
            self._resist(h)

    @ti.func
    def _predict(self, i, h, gravity):
        for block in range(self.board.pitch // LANES):
            at = i * self.board.pitch + block * LANES
            free = ti.select(self.board.get(self.board.w, at) > 0.0, h * h, 0.0)
            for d in ti.static(range(3)):
                x, v = self.board.get(self.board.x[d], at), self.board.get(self.board.v[d], at)
                self.board.put(self.board.start[d], at, x)
                self.board.put(self.board.x[d], at, x + h * v + free * gravity[d])

    @ti.func
    def _resist(self, h):
        """Isometric bending as a force at the predicted places, no stiffer than a substep of h can carry."""
        if ti.static(self.bending.present):
            for i in range(self.board.ni):
                self._clear(i)
            self.bending.add(self.pull, self.board.x, self._bent(h))
            for i in range(self.board.ni):
                self._kick(i, i, h * h)

    @ti.func
    def _bent(self, h):
        """Share of bending that a substep of h can carry."""
        return ti.min(1.0, (self.bend_within[None] / h) ** 2)

    @ti.func
    def _clear(self, row):
        for k in range(self.board.pitch):
            for d in ti.static(range(3)):
                self.pull[d][row * self.board.pitch + k] = 0.0

    @ti.func
    def _kick(self, i, row, h_sq):
        """x += h^2 w pull, of nodes i; what pulls them stands in `row`."""
        for block in range(self.board.pitch // LANES):
            at, pulled = i * self.board.pitch + block * LANES, row * self.board.pitch + block * LANES
            w = h_sq * self.board.get(self.board.w, at)
            for d in ti.static(range(3)):
                x, f = self.board.get(self.board.x[d], at), self.board.get(self.pull[d], pulled)
                self.board.put(self.board.x[d], at, x + w * f)

    @ti.func
    def _finish(self, h, left):
        for i in range(self.board.ni):
            self._slow(i, h, left)

    @ti.func
    def _slow(self, i, h, left):
        """v of the nodes i after a substep."""
        for block in range(self.board.pitch // LANES):
            at = i * self.board.pitch + block * LANES
            for d in ti.static(range(3)):
                x, start = self.board.get(self.board.x[d], at), self.board.get(self.board.start[d], at)
                self.board.put(self.board.v[d], at, left * ((x - start) / h))

    @ti.func
    def _store(self, slowed):
        for node in range(self.node_count):
            at = self.board.place(node)
            if self.board.w[at] > 0.0:
                self.x[node] = self.board.vector(self.board.x, at)
                self.v[node] = slowed * self.board.vector(self.board.v, at)
            elif ti.static(self.clips_move):
                self.x[node] = self.board.vector(self.board.x, at)
