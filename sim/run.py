"""A run and its folder: config, frames, ledger and checkpoint on disk, such that a killed run goes on bit for bit.

Frame n is written, then its row of the ledger, then the checkpoint of frame n: whatever a checkpoint speaks of is on
disk already, and what comes after it is written again.
"""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim import checkpoint, config, frame
from sim.errors import ConfigError, DivergedError, RunError, SeepError
from sim.frame import Frame
from sim.ledger import COLUMNS
from sim.schema import Config
from sim.shapes import Mesh

VERSION = "0.1.0"
OUTPUTS = Path(__file__).resolve().parents[1] / "outputs"
SAME_BITS = ("run.threads",)
"""Keys in which a resumed run may differ: the bits do not depend on them."""


@dataclass(frozen=True)
class RunFolder:
    """Where a run's files are."""

    path: Path

    @property
    def label(self) -> str:
        """As the user names it: `seep/003`, or the path."""
        parts = self.path.resolve().parts
        return "/".join(parts[-2:]) if OUTPUTS.resolve() in self.path.resolve().parents else str(self.path)

    @property
    def config(self) -> Path:
        return self.path / "config.toml"

    @property
    def json(self) -> Path:
        return self.path / "run.json"

    @property
    def ledger(self) -> Path:
        return self.path / "ledger.csv"

    @property
    def checkpoint(self) -> Path:
        return self.path / "checkpoint.npz"

    @property
    def static(self) -> Path:
        return self.path / "frames" / "static.npz"

    @property
    def video(self) -> Path:
        return self.path / "video.mp4"

    def frame(self, index: int) -> Path:
        return self.path / "frames" / f"{index:06d}.npz"

    def image(self, index: int) -> Path:
        return self.path / "images" / f"{index:06d}.png"

    def frames(self) -> list[int]:
        """Numbers of the frames there are."""
        return sorted(int(p.stem) for p in (self.path / "frames").glob("[0-9]*.npz"))

    def record(self) -> dict[str, Any]:
        """run.json, {} if there is none."""
        try:
            return json.loads(self.json.read_text())
        except (OSError, ValueError):
            return {}


@dataclass(frozen=True)
class Plan:
    """Where a run will be; nothing is written yet. path None: the next number in outputs/<scene>.

    finished: the run that --resume names is done, so there is nothing to simulate.
    """

    path: Path | None
    resuming: bool = False
    finished: bool = False


def plan(conf: Config, out: Path | None = None, resume: bool = False) -> Plan:
    """Check --out and --resume before anything is built. ConfigError if the folder will not do."""
    if not resume:
        if out and out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise ConfigError(f"--out {out}: is there already and not empty; name another, or go on with --resume")
        return Plan(out)
    if out:
        different = _differences(RunFolder(out), conf)
        if different:
            raise ConfigError(f"{out}: not the same run: {different}")
        return Plan(out, resuming=True, finished=RunFolder(out).record().get("state") == "finished")
    waiting = [f for f in reversed(runs(conf.name)) if f.record().get("state") in ("running", "interrupted")]
    reasons = []
    for folder in waiting:
        different = _differences(folder, conf)
        if not different:
            return Plan(folder.path, resuming=True)
        reasons.append(f"{folder.label}: not the same run: {different}")
    raise ConfigError(reasons[0] if reasons else f"{conf.name}: no unfinished run to resume in outputs/{conf.name}")


def runs(scene: str) -> list[RunFolder]:
    """The numbered runs of a scene, oldest first."""
    folders = [p for p in (OUTPUTS / scene).glob("[0-9]*") if p.name.isdigit() and p.is_dir()]
    return [RunFolder(p) for p in sorted(folders, key=lambda p: int(p.name))]


def find(name: str) -> RunFolder:
    """RUN of the command line: a path, `seep/003`, or `seep` (the newest). ConfigError if there is no such run."""
    for path in (Path(name), OUTPUTS / name):
        if (path / "config.toml").is_file():
            return RunFolder(path)
    there = runs(name)
    if not there:
        raise ConfigError(f"{name}: no such run; name a folder, scene/number such as seep/001, or a scene")
    return there[-1]


def drive(
    world: Any, conf: Config, where: Plan, on_frame: Callable[[RunFolder, int, Frame], None] | None = None
) -> RunFolder:
    """Simulate to the last frame, writing as it goes; on_frame is told of each frame once it is on disk.

    Ctrl-C ends after the frame in hand, with a checkpoint (KeyboardInterrupt); a second one ends at once.
    Raises DivergedError with the last frame kept, RunError if the disk refuses.
    """
    folder = _prepare(conf, where)
    last = _begin(world, folder, where.resuming, on_frame)
    started, first = time.perf_counter(), last
    _record(folder, conf, "running", last)
    try:
        with _polite_interrupt() as interrupted:
            while last < world.frame_count:
                snapshot = world.advance()
                last += 1
                _keep(world, folder, last, snapshot, on_frame)
                due = conf.run.checkpoint and last % conf.run.checkpoint == 0
                if due or interrupted.is_set() or last == world.frame_count:
                    checkpoint.write(folder.checkpoint, last, world.save())
                if interrupted.is_set():
                    raise KeyboardInterrupt
    except KeyboardInterrupt:
        _record(folder, conf, "interrupted", last)
        raise
    except DivergedError as error:
        _record(folder, conf, "diverged", last, {"reason": str(error)})
        raise DivergedError(f"{folder.label}: {error}; kept frame {last}") from error
    except SeepError:
        _record(folder, conf, "interrupted", last)
        raise
    simulated = (last - first) / conf.run.fps
    seconds = (time.perf_counter() - started) / simulated if simulated else None
    measured = {"resumed_from": first or None, "seconds_per_simulated_second": seconds, **world.summary()}
    _record(folder, conf, "finished", last, measured)
    return folder


def _differences(folder: RunFolder, conf: Config) -> str:
    """In what the run in this folder is not the one asked for; "" if it is the same."""
    if not folder.config.is_file():
        raise ConfigError(f"--resume: {folder.path}: holds no run")
    found = config.differences(config.load(folder.config), conf, SAME_BITS)
    return found[0] + (f" (and {len(found) - 1} more)" if len(found) > 1 else "") if found else ""


def _prepare(conf: Config, where: Plan) -> RunFolder:
    """Make the folder and write config.toml, unless the run goes on."""
    try:
        folder = RunFolder(where.path or _next_number(conf.name))
        for part in ("frames", "images"):
            (folder.path / part).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"{error.filename}: cannot make the run's folder: {error.strerror}") from error
    if not where.resuming:
        _copy_meshes(folder, conf)
        checkpoint.write_text(folder.config, config.resolved_toml(conf))
    return folder


def _copy_meshes(folder: RunFolder, conf: Config) -> None:
    """What the scene reads besides itself, so that the folder runs again by itself."""
    for name, solid in conf.solid.items():
        if isinstance(solid, Mesh):
            (folder.path / "meshes").mkdir(exist_ok=True)
            source = Path(solid.found)
            content = source.read_bytes()
            copy = folder.path / "meshes" / f"{name}{source.suffix}"
            checkpoint.write_whole(copy, lambda file, content=content: file.write(content))


def _next_number(scene: str) -> Path:
    """outputs/<scene>/<NNN>, made; two runs that start together get two numbers."""
    while True:
        there = runs(scene)
        path = OUTPUTS / scene / f"{int(there[-1].path.name) + 1 if there else 1:03d}"
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            path.mkdir()
            return path
        except FileExistsError:
            continue


def _begin(world: Any, folder: RunFolder, resuming: bool, on_frame: Callable | None) -> int:
    """Frame 0 on disk, or the state of the checkpoint in the world; returns the number of the frame reached."""
    if resuming and folder.checkpoint.exists():
        last, state = checkpoint.read(folder.checkpoint)
        if lacking := sorted(world.save().keys() - state.keys()):
            raise RunError(
                f"{folder.checkpoint}: written by another version of this program, without {lacking[0]}; "
                "start the run again without --resume"
            )
        world.load(state)
        _cut_ledger(folder.ledger, last)
        return last
    frame.write(folder.static, world.static)
    checkpoint.write_text(folder.ledger, ",".join(COLUMNS) + "\n")
    _keep(world, folder, 0, world.snapshot(), on_frame)
    checkpoint.write(folder.checkpoint, 0, world.save())
    return 0


def _keep(world: Any, folder: RunFolder, index: int, snapshot: Frame, on_frame: Callable | None) -> None:
    """One frame and its row of the ledger, forced to disk."""
    frame.write(folder.frame(index), snapshot)
    row = world.ledger_row()
    line = ",".join(_cell(row[column]) for column in COLUMNS)
    try:
        with open(folder.ledger, "a", encoding="ascii") as file:
            file.write(line + "\n")
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise RunError(f"{folder.ledger}: cannot write: {error.strerror}") from error
    if on_frame:
        on_frame(folder, index, snapshot)


def _cell(value: Any) -> str:
    """A number to the last bit; what is not modelled is empty."""
    if value is None:
        return ""
    return repr(value.item() if isinstance(value, np.generic) else value)


def _cut_ledger(path: Path, last: int) -> None:
    """Drop the rows of frames after `last`: they will be written again."""
    try:
        header, *rows = path.read_text().splitlines()
    except (OSError, ValueError) as error:
        raise RunError(f"{path}: cannot read; start the run again without --resume") from error
    kept = [row for row in rows if row.split(",")[0].isdigit() and int(row.split(",")[0]) <= last]
    checkpoint.write_text(path, "\n".join([header, *kept]) + "\n")


def _record(folder: RunFolder, conf: Config, state: str, last: int, more: dict[str, Any] | None = None) -> None:
    """run.json: where the run stands ("running" until told otherwise), and on what it ran."""
    settings = {"arch": conf.run.arch, "threads": conf.run.threads or os.cpu_count(), "precision": conf.run.precision}
    record = {"state": state, "frames": last, "version": VERSION, "scene": conf.name, "seed": conf.run.seed, **settings}
    text = json.dumps({**record, **(more or {})}, indent=2, default=lambda value: value.item())
    checkpoint.write_text(folder.json, text + "\n")


@contextmanager
def _polite_interrupt() -> Iterator[threading.Event]:
    """Ctrl-C sets the event; a second Ctrl-C interrupts as ever. Off the main thread signals stay as they are."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    def ask(*_: Any) -> None:
        asked.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)
