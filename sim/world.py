"""A scene made to move: allocates the rows that its stages name, runs the pipeline, yields Frames."""

import hashlib
import math
import time
from collections import defaultdict

import numpy as np

from sim import guard, registry
from sim.bodies import Bodies
from sim.clock import Clock
from sim.cloth.clips import Clips
from sim.cloth.wind import Wind
from sim.fluid import roster
from sim.frame import Frame, Static
from sim.ledger import Masses, kinetic_energy, top_speed
from sim.pipeline import in_order
from sim.scene.build import build_scene
from sim.stage import Build
from sim.state import ROWS, State
from sim.wetting import room


class World:
    """One a process. Taichi must have been started (sim.runtime.start).

    World(config)      at t = 0, the cloth settled
    advance()          simulate to the next frame and return it; raises DivergedError with the state of the failure
    step()             one time step of it
    snapshot()         the Frame now; static: what does not change
    save(), load()     the whole state, bit for bit
    ledger_row()       dict of ledger.csv's columns, summary(): dict for run.json
    """

    def __init__(self, config):
        registry.discover()
        self.config = config
        self.scene = build_scene(config)
        self.state = State(self._rows(), self._sizes())
        self.build = Build(config, self.scene, self.state)
        self.clock = Clock(config.run.fps, config.run.dt_max, config.run.dt_min, config.run.dt_limits)
        self.build.parts["clock"] = self.clock
        self.stages = in_order(self._build_stages())
        self.frame_count = config.run.frame_count
        self.seconds = defaultdict(float)
        self.iterations = 0
        self.first = {"first_contact": None, "first_drop": None}
        self.steps_in_frame, self.stood = 0, 0.0
        self._fill()

    def _classes(self) -> list[type]:
        config, classes = self.config, []
        if config.fluid:
            classes += roster.methods(config)
        if config.cloth:
            classes.append(registry.method("cloth.solver", config.cloth.method))
            classes += [Clips] if Clips.wanted(config) else []
            if config.cloth.self_contact:
                classes.append(registry.method("cloth.self_contact", config.cloth.self_contact))
        if config.coupling:
            classes.append(registry.method("coupling.contact", config.coupling.contact))
        if config.wetting:
            classes += room.chosen(config)
        return classes

    def _rows(self) -> list:
        names, scratch = set(), []
        for cls in self._classes():
            names.update(cls.rows)
            scratch += cls.scratch
        if self.config.wetting:
            names.update(room.ROWS)
        return [row for row in ROWS.values() if row.name in names] + scratch

    def _sizes(self) -> dict[str, int]:
        sizes = roster.sizes(self.scene.water) if self.scene.water else {}
        if self.scene.sheet:
            sizes |= {"cloth": len(self.scene.sheet.x), "patch": len(self.scene.sheet.patches)}
        return sizes

    def _build_stages(self) -> list:
        config, build = self.config, self.build
        stages = [*Bodies.of(build).stages(), *(roster.build_fluid(build) if config.fluid else [])]
        if config.coupling:
            contact = registry.method("coupling.contact", config.coupling.contact)(build, config.coupling.params)
            stages += contact.stages()
        if config.cloth:
            if Clips.wanted(config):
                stages += Clips(build).stages()
            if config.space.wind is not None:
                Wind(build)
            if config.cloth.self_contact:
                contact = registry.method("cloth.self_contact", config.cloth.self_contact)
                contact(build, config.cloth.self_contact_params)
            solver = registry.method("cloth.solver", config.cloth.method)(build, config.cloth.params)
            build.parts["cloth"] = solver
            stages += solver.stages()
        if config.wetting:
            stages += room.build_wetting(build)
        return stages

    def _fill(self) -> None:
        """The sheet's rows, and its rest under gravity before t = 0."""
        if not self.scene.sheet:
            return
        sheet, state = self.scene.sheet, self.state
        dtype = np.float64 if self.config.run.precision == "f64" else np.float32
        for name in ("x", "mass", "inv_mass"):
            state[f"cloth.{name}"].from_numpy(np.ascontiguousarray(getattr(sheet, name), dtype))
        self.build.parts["cloth"].settle(self.config.cloth.settle)

    @property
    def frame_index(self) -> int:
        """Frames behind us."""
        return self.clock.frame

    def advance(self) -> Frame:
        """Simulate to the next frame."""
        while not self.step():
            pass
        return self.snapshot()

    def step(self) -> bool:
        """One time step; True when it ended a frame, which the guard has then looked at."""
        if self.clock.elapsed == 0.0:
            self.steps_in_frame = 0
            self.stood = 0.0
        ended = self.go(self.clock.next_step(self.stages))
        self._note_firsts()
        if ended:
            self._check()
        return ended

    def go(self, dt: float) -> bool:
        """dt forward, past the limits and the guard; True if it ended a frame. A step that contact took back is gone
        anew in halves, unless it is a short one: then time goes on without it."""
        if not self._run_stages(dt):
            if dt > self.build.parts["contact"].short:
                self._forget(dt)
                self.go(0.5 * dt)
                return self.go(0.5 * dt)
            self.stood += dt
        self.steps_in_frame += 1
        return self.clock.advance(dt)

    def _run_stages(self, dt: float) -> bool:
        """Every stage in order, up to the one that took the step back if one does (False)."""
        contact = self.build.parts.get("contact")
        for stage in self.stages:
            began = time.perf_counter()
            stage.run(dt)
            self.seconds[stage.name] += time.perf_counter() - began
            if stage.slot == "catch" and contact.took_back:
                return False
        if "pressure" in self.build.parts:
            self.iterations += sum(getattr(self.build.parts["pressure"], "iterations", {}).values())
        return True

    def _forget(self, dt: float) -> None:
        """Stages that count time count that of a step taken back no more."""
        for stage in self.stages:
            if stage.forget:
                stage.forget(dt)

    def _note_firsts(self) -> None:
        parts = self.build.parts
        if "contact" in parts and self.first["first_contact"] is None and parts["contact"].touched[None]:
            self.first["first_contact"] = self.clock.time
        if "drip" in parts and self.first["first_drop"] is None and parts["drip"].drops[None]:
            self.first["first_drop"] = self.clock.time

    def _check(self) -> None:
        """The guard, once a frame."""
        now, config = self.clock.time, self.config
        if config.fluid:
            living = self.state.count[None]
            x, v, ids = (self.state[f"fluid.{n}"].to_numpy()[:living] for n in ("x", "v", "id"))
            suspects = guard.known_causes(config, self.clock.overstep, roster.suspects(self.build))
            guard.check_things("particle", x, v, ids, now, config, suspects)
            guard.check_density(self.build.parts["pairs"].density()[:living], x, ids, now, config, suspects)
        if config.cloth:
            x, v = (self.state[f"cloth.{n}"].to_numpy() for n in "xv")
            guard.check_things("cloth node", x, v, np.arange(len(x)), now, config, self.build.parts["cloth"].suspects())
        if config.coupling and self.build.parts["contact"].tight:
            guard.check_leaks(self.build.parts["contact"].counts()["leaks"], now)
            guard.check_standing(self.stood * config.run.fps, now, config)

    @property
    def static(self) -> Static:
        """What pictures need once."""
        config, solids, sheet = self.config, self.scene.solids, self.scene.sheet
        return Static(
            spacing=np.float32(config.fluid.spacing if config.fluid else 0.0),
            ground_z=np.float32(solids.ground_z),
            cloth_colour=linear_rgb(config.render.cloth_colour or (config.cloth.fabric.colour if sheet else "#ffffff")),
            solid_x=solids.corners(0.0).astype(np.float32) if len(solids.triangles) else None,
            solid_triangles=solids.triangles if len(solids.triangles) else None,
            solid_opaque=np.int32(solids.opaque),
            cloth_triangles=np.asarray(sheet.triangles, np.int32) if sheet else None,
            cloth_uv=sheet.uv.astype(np.float32) if sheet else None,
            cloth_thickness=np.float32(sheet.thickness) if sheet else None,
            fluid_absorption=np.float32(config.fluid.liquid.absorption) if config.fluid else None,
        )

    def snapshot(self) -> Frame:
        """What pictures need of this moment; water sorted by id."""
        frame = Frame(time=np.float64(self.clock.time))
        if self.scene.solids.moves:
            frame.solid_x = self.scene.solids.corners(self.clock.time).astype(np.float32)
        if self.config.fluid:
            living = self.state.count[None]
            ids = self.state["fluid.id"].to_numpy()[:living]
            order = np.argsort(ids)
            frame.fluid_id = ids[order]
            for name in ("x", "v", "mass"):
                rows = self.state[f"fluid.{name}"].to_numpy()[:living]
                setattr(frame, f"fluid_{name}", rows[order].astype(np.float32))
        if self.config.cloth:
            frame.cloth_x = self.state["cloth.x"].to_numpy().astype(np.float32)
            frame.cloth_v = self.state["cloth.v"].to_numpy().astype(np.float32)
        if self.config.wetting:
            frame.cloth_saturation, frame.cloth_film = self.build.parts["cloth_water"].on_nodes()
        return frame

    def masses(self) -> Masses:
        """Every gram, in whole units."""
        masses = Masses()
        if self.config.fluid:
            population = self.build.parts["population"]
            masses.emitted, masses.drained = population.emitted_units(), population.drained_units()
            masses.free = int(self.state["fluid.mass_units"].to_numpy()[: self.state.count[None]].sum())
        if self.config.wetting:
            masses.held, masses.film = self.build.parts["cloth_water"].totals()
        return masses

    def ledger_row(self) -> dict:
        """The columns of ledger.csv; None where the scene does not model it."""
        row = {"frame": self.clock.frame, "time": self.clock.frame / self.clock.fps, **self.masses().columns()}
        row |= dict.fromkeys(("leaks", "passed", "density_error", "max_strain"))
        if self.config.coupling:
            row["leaks"] = self.build.parts["contact"].counts()["leaks"]
        speed, energy = 0.0, 0.0
        for group in ("fluid", "cloth"):
            if f"{group}.v" in self.state:
                living = self.state.count[None] if group == "fluid" else None
                v, m = (self.state[f"{group}.{n}"].to_numpy()[:living] for n in ("v", "mass"))
                speed, energy = max(speed, top_speed(v)), energy + kinetic_energy(m, v)
        row |= {"max_speed": speed, "kinetic_energy": energy}
        if self.config.fluid:
            row["density_error"] = self._density_error()
        if self.config.cloth:
            row["max_strain"] = self.build.parts["cloth"].max_strain()
        row["dt"] = 1.0 / (self.clock.fps * max(self.steps_in_frame, 1))
        return row

    def _density_error(self) -> float:
        """Mean compression, max(rho/rho0 - 1, 0), over the water."""
        density = self.state["fluid.density"].to_numpy()[: self.state.count[None]].astype(np.float64)
        rest = self.config.fluid.liquid.rest_density
        return float(np.maximum(density / rest - 1.0, 0.0).mean()) if len(density) else 0.0

    def save(self) -> dict:
        """All that the future depends on."""
        kept = {f"row/{name}": values for name, values in self.state.save().items()}
        kept |= {"clock/frame": self.clock.frame, "clock/step": self.clock.step}
        kept |= {"note/iterations": self.iterations, "note/steps_in_frame": self.steps_in_frame}
        kept |= {f"note/{n}": math.nan if t is None else t for n, t in self.first.items()}
        for part in ("contact", "drip"):
            if part in self.build.parts:
                kept |= {f"count/{part}/{n}": int(f[None]) for n, f in self._counters(part).items()}
        return {name: np.asarray(value) for name, value in kept.items()}

    def _counters(self, part: str) -> dict:
        if part == "drip":
            return {"drops": self.build.parts["drip"].drops}
        return self.build.parts["contact"].counters()

    def load(self, kept: dict) -> None:
        """The reverse of `save`."""
        self.state.load({name[4:]: values for name, values in kept.items() if name.startswith("row/")})
        self.clock.frame, self.clock.step = int(kept["clock/frame"]), int(kept["clock/step"])
        self.clock.elapsed, self.clock.overstep = 0.0, None
        self.iterations, self.steps_in_frame = int(kept["note/iterations"]), int(kept["note/steps_in_frame"])
        self.first = {n: None if math.isnan(kept[f"note/{n}"]) else float(kept[f"note/{n}"]) for n in self.first}
        for part in ("contact", "drip"):
            if part in self.build.parts:
                for name, field in self._counters(part).items():
                    field[None] = int(kept[f"count/{part}/{name}"])

    def state_hash(self) -> str:
        """sha256 over every saved row."""
        digest = hashlib.sha256()
        for name, values in sorted(self.state.save().items()):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(values).tobytes())
        return digest.hexdigest()

    def summary(self) -> dict:
        """For run.json."""
        return {
            "state_hash": self.state_hash(),
            "stages": {name: round(seconds, 4) for name, seconds in self.seconds.items()},
            "particle_count": int(self.state.count[None]) if self.config.fluid else 0,
            "cloth_count": len(self.scene.sheet.x) if self.scene.sheet else 0,
            "steps": self.clock.step,
            "iterations": self.iterations,
            **self.first,
            **(self.build.parts["contact"].counts() if self.config.coupling else {}),
        }


def linear_rgb(colour: str) -> np.ndarray:
    """ "#rrggbb" in sRGB -> (3,) f32, linear 0..1 (IEC 61966-2-1)."""
    encoded = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)
