"""The command line: plain lines, exit codes, nothing written for wrong input, no Taichi where none is needed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import main as seep
from sim import run

ROOT = Path(__file__).resolve().parents[1]

GOOD = """schema = 1
[run]
duration = "0.2 s"
fps = 10
[cloth]
size = ["8 cm", "8 cm"]
spacing = "2 cm"
"""

WRONG_FILES = {
    "unknown key": (
        GOOD.replace("spacing", "spcing"),
        'x.toml: cloth.spcing = "2 cm": unknown key; did you mean cloth.spacing?',
    ),
    "unknown section": (GOOD + "[clotg]\nsize = 1\n", "x.toml: clotg: unknown key; did you mean cloth?"),
    "wrong unit": (GOOD.replace("2 cm", "2 s"), 'x.toml: cloth.spacing = "2 s": needs a length, such as "2 mm"'),
    "out of range": (
        GOOD + "[cloth.fabric]\nporosity = 1.4\n",
        "x.toml: cloth.fabric.porosity = 1.4: must lie in (0, 1)",
    ),
    "missing card": (
        GOOD + '[cloth.fabric]\ncard = "wool"\n',
        "x.toml: cloth.fabric.card = wool: no such fabric; there are",
    ),
    "not TOML": (GOOD + "fps 30\n", "x.toml: line 8: not TOML: expected '=' after a key"),
    "not text": ("\xff\xfe", "x.toml: not TOML"),
    "no schema": (GOOD.replace("schema = 1\n", ""), "x.toml: schema: missing; write schema = 1"),
    "newer schema": (GOOD.replace("schema = 1", "schema = 2"), "x.toml: schema = 2: this program reads schema 1"),
    "missing key": (
        GOOD.replace('duration = "0.2 s"\n', ""),
        'x.toml: run.duration: missing; needs a time, such as "2 ms"',
    ),
    "nothing to do": (GOOD.split("[cloth]")[0], "x.toml: fluid: missing, and so is [cloth]"),
    "not a table": (
        GOOD.split("[cloth]")[0].replace("schema = 1", "schema = 1\ncloth = 3"),
        "x.toml: cloth = 3: must be a table: [cloth]",
    ),
    "not finite": (GOOD.replace('"0.2 s"', "nan"), "x.toml: run.duration = nan: must be finite"),
    "unknown method": (GOOD + 'method = "fem"\n', 'x.toml: cloth.method = "fem": no method "fem"; choose from'),
    "unknown base": ('extends = "bass"\n' + GOOD, "x.toml: extends = bass: no such scene"),
    "several": (
        GOOD.replace("fps = 10", "fps = 0").replace("2 cm", "-2 cm"),
        "x.toml: run.fps = 0: must lie in [1, 10000] (and 1 more)",
    ),
}


@pytest.fixture
def nowhere(tmp_path, monkeypatch):
    """An empty folder to stand in, with the outputs in it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run, "OUTPUTS", tmp_path / "outputs")
    return tmp_path


@pytest.mark.parametrize("text, line", WRONG_FILES.values(), ids=WRONG_FILES)
def test_a_wrong_file_is_one_clear_line(nowhere, capsys, text, line):
    Path("x.toml").write_bytes(text.encode("latin-1"))
    assert seep.main(["run", "x.toml", "--out", "here"]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1
    assert line in told.err
    assert [p.name for p in nowhere.iterdir()] == ["x.toml"]


@pytest.mark.parametrize(
    "arguments, line",
    [
        (["run", "sep"], "sep: no such scene; did you mean seep?"),
        (["run", "no/such.toml"], "no/such.toml: no such file"),
        (["run", "seep", "--set", "fluid.spacing"], "needs KEY=VALUE"),
        (["run", "seep", "--quik"], "No such option"),
        (["run", "seep", "--frames", "0"], "frames"),
        (["run", "seep", "--precision", "f16"], "run.precision"),
        (["run", "seep", "--threads", "-1"], "run.threads = -1"),
        (["rn"], "No such command 'rn'"),
        (["video", "seep"], "seep: no such run"),
        (["scenes", "--fabric", "wool"], "wool: no such fabric; there are"),
        (["run", "tablecloth", "--resume"], "no unfinished run"),
    ],
)
def test_wrong_options_are_one_clear_line(nowhere, capsys, arguments, line):
    assert seep.main(arguments) == 2
    told = capsys.readouterr()
    assert line in told.err and told.err.count("\n") == 1
    assert not list(nowhere.iterdir())


def test_scenes_are_listed(capsys):
    assert seep.main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == sorted(p.stem for p in (ROOT / "configs/scenes").glob("*.toml"))
    assert all(len(line.split()) > 1 for line in lines)


def test_methods_are_listed_with_parameters(capsys):
    assert seep.main(["scenes", "--methods"]) == 0
    text = capsys.readouterr().out
    for words in ("dfsph", "xpbd", "substep_max = 0.0001", "drop_radius", "coupling.search"):
        assert words in text


def test_a_card_is_shown_with_what_follows(capsys):
    assert seep.main(["scenes", "--fabric", "cotton"]) == 0
    text = capsys.readouterr().out
    assert "a pool drains with a time of" in text and "permeability_through" in text


def test_doctor_names_the_limit_that_binds(capsys):
    assert seep.main(["doctor", "seep"]) == 0
    assert "binds" in capsys.readouterr().out


def command(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "main.py", *arguments], cwd=ROOT, capture_output=True, text=True, timeout=120
    )


def test_doctor_fits_ten_lines():
    told = command("doctor")
    assert told.returncode == 0 and len(told.stdout.splitlines()) == 10 and told.stderr == ""


def test_wrong_input_and_help_need_no_taichi():
    """Taichi takes most of a second to import: a typing error should not wait for it."""
    code = "import sys, main; code = main.main({}); print('taichi' in sys.modules); sys.exit(code)"
    for arguments, expected in ((["--help"], 0), (["run", "seep", "--set", "fluid.spcing=1"], 2), (["scenes"], 0)):
        told = subprocess.run(
            [sys.executable, "-c", code.format(arguments)], cwd=ROOT, capture_output=True, text=True, env={**os.environ}
        )
        assert told.returncode == expected
        assert told.stdout.splitlines()[-1] == "False"
        assert "Traceback" not in told.stderr


def test_a_small_run_from_the_command_line(tmp_path):
    """Simulated, drawn, filmed, resumed, filmed again at another size; and a second run into it is refused."""
    (tmp_path / "x.toml").write_text(GOOD + '[solid.ground]\nshape = "plane"\n[render]\nsize = [64, 48]\n')
    scene, out = str(tmp_path / "x.toml"), tmp_path / "out"
    told = command("run", scene, "--out", str(out))
    assert told.returncode == 0, told.stderr
    assert "\r" not in told.stderr and told.stderr == ""
    made = {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()}
    assert made >= {"config.toml", "run.json", "ledger.csv", "ledger.png", "video.mp4", "checkpoint.npz"}
    assert {f"images/{n:06d}.png" for n in range(3)} <= made
    assert command("run", scene, "--out", str(out)).returncode == 2
    assert "finished already" in command("run", scene, "--out", str(out), "--resume").stdout
    film = tmp_path / "again.mp4"
    assert command("video", str(out), "--size", "34x56", "--out", str(film)).returncode == 0
    import imageio_ffmpeg

    header = next(imageio_ffmpeg.read_frames(str(film)))
    assert header["size"] == (34, 56)


def test_the_window_is_driven_unseen(tmp_path):
    (tmp_path / "x.toml").write_text(GOOD + "[render]\nsize = [64, 48]\n")
    told = command("view", str(tmp_path / "x.toml"), "--capture", str(tmp_path / "seen"), "--frames", "2")
    assert told.returncode == 0, told.stderr
    assert sorted(p.name for p in (tmp_path / "seen").iterdir()) == ["000000.png", "000001.png"]
    from imageio.v3 import imread

    assert imread(tmp_path / "seen" / "000001.png").shape == (48, 64, 3)
