"""A run's folder: numbering, --out, --resume, kill -9, Ctrl-C, divergence. The World is a stand-in of NumPy alone."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from sim import checkpoint, frame, run
from sim.config import load
from sim.errors import ConfigError, DivergedError, RunError
from sim.frame import Frame, Static
from sim.ledger import COLUMNS

SCENE = """
schema = 1
[run]
duration   = "{frames} s"
fps        = 1
checkpoint = {every}
[cloth]
size    = [1, 1]
spacing = 0.5
"""
CHILD = "import sys, test_run as t; t.go(t.Path(sys.argv[1]), t.Path(sys.argv[2]), sys.argv[3] == 'resume', 0.03)"


class Walk:
    """Stands for a World: nodes that wander by a chaotic map, so that one wrong bit shows at once."""

    def __init__(self, config, pause=0.0, diverge_at=None):
        self.frame_count, self.frame_index = config.run.frame_count, 0
        self.pause, self.diverge_at = pause, diverge_at
        self.x = np.linspace(0.1, 0.9, 12).reshape(4, 3)
        self.steps = 0
        self.static = Static(np.float32(0), np.float32(0), np.zeros(3, np.float32))

    def advance(self) -> Frame:
        time.sleep(self.pause)
        if self.frame_index + 1 == self.diverge_at:
            raise DivergedError("exploding at t = 3 s; lower cloth.xpbd.substep_max")
        for _ in range(7):
            self.x = 3.9 * self.x * (1 - self.x)
            self.steps += 1
        self.frame_index += 1
        return self.snapshot()

    def snapshot(self) -> Frame:
        return Frame(time=np.float64(self.frame_index), cloth_x=self.x.astype(np.float32))

    def ledger_row(self) -> dict:
        row = dict.fromkeys(COLUMNS)
        return row | {"frame": self.frame_index, "time": float(self.frame_index), "max_speed": self.x.max()}

    def save(self) -> dict:
        return {"cloth/x": self.x, "steps": self.steps, "frame": self.frame_index}

    def load(self, kept: dict) -> None:
        self.x, self.steps, self.frame_index = kept["cloth/x"], int(kept["steps"]), int(kept["frame"])

    def summary(self) -> dict:
        return {"steps": self.steps, "state_hash": self.x.tobytes().hex()[:16]}


def go(scene: Path, out: Path, resume: bool = False, pause: float = 0.0, **more) -> run.RunFolder:
    config = load(scene)
    where = run.plan(config, out, resume)
    return run.drive(Walk(config, pause, **more), config, where)


@pytest.fixture
def scene(tmp_path):
    def write(frames=12, every=1, name="walk"):
        path = tmp_path / f"{name}.toml"
        path.write_text(SCENE.format(frames=frames, every=every))
        return path

    return write


def contents(folder: Path) -> dict[str, bytes]:
    """Everything a run is judged by."""
    files = [folder / "ledger.csv", folder / "checkpoint.npz", *sorted((folder / "frames").glob("*.npz"))]
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}


def test_a_run_leaves_its_folder(scene, tmp_path):
    folder = go(scene(frames=3), tmp_path / "out")
    assert folder.frames() == [0, 1, 2, 3]
    rows = folder.ledger.read_text().splitlines()
    assert rows[0].split(",") == list(COLUMNS) and len(rows) == 5
    assert rows[1].startswith("0,0.0,,,")
    record = folder.record()
    assert record["state"] == "finished" and record["steps"] == 21 and record["frames"] == 3
    assert load(folder.config) == load(scene(frames=3))
    assert frame.read(folder.static, Static).spacing == 0
    assert not list((tmp_path / "out").rglob("*.part"))


def test_out_must_be_absent_or_empty(scene, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    with pytest.raises(ConfigError, match="not empty"):
        go(scene(), tmp_path / "full")
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["thesis.txt"]
    (tmp_path / "empty").mkdir()
    assert go(scene(frames=1), tmp_path / "empty").frames() == [0, 1]


def test_runs_are_numbered_and_found(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "OUTPUTS", tmp_path / "outputs")
    paths = [go(scene(frames=1), None).path for _ in range(2)]
    assert [p.name for p in paths] == ["001", "002"]
    assert run.find("walk").path == paths[1]
    assert run.find("walk/001").path == paths[0] and run.find(str(paths[0])).path == paths[0]
    assert run.find("walk").label == "walk/002"
    with pytest.raises(ConfigError, match="no such run"):
        run.find("stroll")


@pytest.mark.parametrize("every", [1, 4, 0])
def test_killed_and_resumed_is_bit_for_bit_the_unbroken_run(scene, tmp_path, every):
    path = scene(every=every)
    whole = contents(go(path, tmp_path / "whole").path)
    out = tmp_path / "killed"
    command = [sys.executable, "-c", CHILD, str(path), str(out)]
    place = {"cwd": Path(__file__).parent, "env": {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}}
    child = subprocess.Popen([*command, "anew"], **place)
    target = out / "frames" / f"{int(np.random.default_rng().integers(2, 10)):06d}.npz"
    deadline = time.monotonic() + 20
    while not target.exists() and time.monotonic() < deadline:
        time.sleep(0.002)
    child.kill()
    assert child.wait() == -signal.SIGKILL
    assert json.loads((out / "run.json").read_text())["state"] == "running"
    go(path, out, resume=True)
    assert contents(out) == whole


def test_ctrl_c_keeps_the_frame_in_hand(scene, tmp_path):
    """With no checkpoints asked for, the interrupt itself makes one, and the run goes on from there."""
    path = scene(every=0)
    whole = contents(go(path, tmp_path / "whole").path)
    config = load(path)

    def interrupt(folder, index, snapshot):
        if index == 5:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run.drive(Walk(config), config, run.plan(config, tmp_path / "out"), interrupt)
    folder = run.RunFolder(tmp_path / "out")
    assert folder.record()["state"] == "interrupted" and folder.frames() == list(range(6))
    assert checkpoint.read(folder.checkpoint)[0] == 5
    assert contents(go(path, folder.path, resume=True).path) == whole
    assert folder.record()["resumed_from"] == 5


def test_divergence_keeps_the_last_good_state(scene, tmp_path):
    with pytest.raises(DivergedError, match=r"out: exploding .*; kept frame 6$") as error:
        go(scene(), tmp_path / "out", diverge_at=7)
    assert error.value.exit_code == 3
    folder = run.RunFolder(tmp_path / "out")
    assert folder.record()["state"] == "diverged" and "exploding" in folder.record()["reason"]
    assert folder.frames() == list(range(7)) and checkpoint.read(folder.checkpoint)[0] == 6


def test_resume_picks_the_newest_unfinished_and_names_a_difference(scene, tmp_path, monkeypatch):
    monkeypatch.setattr(run, "OUTPUTS", tmp_path / "outputs")
    config = load(scene())
    with pytest.raises(ConfigError, match="no unfinished run"):
        run.plan(config, resume=True)
    for _ in range(2):
        with pytest.raises(DivergedError):
            run.drive(Walk(config, diverge_at=3), config, run.plan(config))
    with pytest.raises(ConfigError, match="no unfinished run"):
        run.plan(config, resume=True)
    for folder in run.runs("walk"):
        checkpoint.write_text(folder.json, json.dumps({"state": "running"}))
    assert run.plan(config, resume=True).path.name == "002"
    assert run.plan(load(scene(), ["run.threads=2"]), resume=True).resuming
    with pytest.raises(ConfigError, match=r"walk/002: not the same run: run.seed = 1 there, 7 here"):
        run.plan(load(scene(), ["run.seed=7"]), resume=True)
    with pytest.raises(ConfigError, match="holds no run"):
        run.plan(config, tmp_path / "nothing", resume=True)


def test_a_finished_run_has_nothing_to_resume(scene, tmp_path):
    path = scene(frames=2)
    go(path, tmp_path / "out")
    assert run.plan(load(path), tmp_path / "out", resume=True).finished


def test_broken_files_are_told_plainly(scene, tmp_path):
    folder = go(scene(frames=2), tmp_path / "out")
    checkpoint.write(folder.checkpoint, 2, {"cloth/x": np.zeros((4, 3)), "frame": 2})
    with pytest.raises(RunError, match="written by another version of this program, without steps"):
        run._begin(Walk(load(scene(frames=2))), folder, True, None)
    folder.checkpoint.write_bytes(folder.checkpoint.read_bytes()[:100])
    with pytest.raises(RunError, match="not a readable checkpoint"):
        checkpoint.read(folder.checkpoint)
    with pytest.raises(RunError, match="cannot write"):
        checkpoint.write_text(tmp_path / "no" / "such" / "folder.txt", "")


def test_checkpoint_gives_every_bit_back(tmp_path):
    state = {"x": np.array([np.nan, -0.0, 1e-310]), "units": np.array([2**62], np.int64), "time": 1 / 3, "file": 3}
    checkpoint.write(tmp_path / "c.npz", 7, state)
    index, kept = checkpoint.read(tmp_path / "c.npz")
    assert index == 7 and set(kept) == set(state)
    assert all(np.asarray(state[n]).tobytes() == kept[n].tobytes() for n in state)
