"""The shape of the house: imports point one way, files stay short, words are the agreed ones."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LAYERS = (
    ("constants", "errors", "launch", "maths", "units"),
    ("model", "toml", "state", "frame", "registry", "runtime"),
    ("stage", "shapes", "crew"),
    ("schema",),
    ("explain", "preset"),
    ("fit",),
    ("config",),
    ("scene",),
    ("search", "bodies"),
    ("fluid", "cloth"),
    ("coupling", "wetting"),
    ("pipeline", "clock", "ledger", "guard", "checkpoint"),
    ("world",),
    ("run", "listing"),
    ("doctor", "advice", "studies"),
)
"""Rooms of sim/, lowest first. A room knows itself and the rows below it, never its neighbours."""
LONGEST_FILE = 420

FILES = sorted(p for room in ("sim", "render") for p in (ROOT / room).rglob("*.py"))


def imports(path: Path) -> list[str]:
    """Dotted names of what a file imports from this project, wherever in the file it does so."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [f"{node.module}.{alias.name}" for alias in node.names]
    return [name for name in found if name.split(".")[0] in ("sim", "render", "main")]


def row(room: str) -> int:
    return next(n for n, rooms in enumerate(LAYERS) if room in rooms)


@pytest.mark.parametrize("path", [p for p in FILES if p.parts[-2:] != ("sim", "__init__.py")], ids=lambda p: p.stem)
def test_imports_point_one_way(path):
    where = path.relative_to(ROOT).with_suffix("").parts
    for name in imports(path):
        if where[0] == "render":
            known = ("render", "sim.frame", "sim.errors")
            assert name.startswith(known), f"{path.name} imports {name}; render knows only sim.frame"
            continue
        assert name.startswith("sim."), f"{path.name} imports {name}"
        here, there = where[1], name.split(".")[1]
        assert here == there or row(there) < row(here), f"{path.relative_to(ROOT)} imports {name}: not below it"


def test_every_room_has_its_place():
    rooms = {p.relative_to(ROOT / "sim").parts[0].removesuffix(".py") for p in (ROOT / "sim").rglob("*.py")}
    assert rooms - {"__init__"} <= {room for rooms_of_row in LAYERS for room in rooms_of_row}


def test_files_stay_short():
    long = {str(p.relative_to(ROOT)): n for p in FILES if (n := len(p.read_text().splitlines())) > LONGEST_FILE}
    assert not long


def test_public_names_have_docstrings():
    bare = []
    for path in FILES:
        for node in ast.parse(path.read_text()).body:
            named = isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_")
            if named and not ast.get_docstring(node):
                bare.append(f"{path.relative_to(ROOT)}: {node.name}")
    assert not bare


def test_versions_agree():
    from sim.run import VERSION

    assert f'version = "{VERSION}"' in (ROOT / "pyproject.toml").read_text()


def test_lock_names_no_index_and_no_path():
    text = (ROOT / "requirements.lock").read_text()
    assert "http" not in text and "file:" not in text and "index-url" not in text
    assert all("--hash=sha256:" in block for block in text.split("\n\n") if "==" in block)
