"""What every test shares: Taichi's greeting off, scene files made on the spot."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

LONGEST = (
    "test_seep",
    "test_folds",
    "test_mueller",
    "test_wetting",
    "test_coupling",
    "test_fluid",
    "test_solids",
    "test_moving_solids",
)
"""Of the files. They come first, so that two workers, a file each at a time, end together."""

SMALL = """
schema = 1

[run]
duration = "0.2 s"
fps      = 10

[cloth]
size    = ["8 cm", "8 cm"]
spacing = "2 cm"
centre  = [0.0, 0.0, 0.1]

[solid.ground]
shape = "plane"
"""


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: item.path.stem not in LONGEST)


@pytest.fixture
def scene_file(tmp_path: Path):
    """scene_file(text) -> path of a scene with that text; the small cloth-only scene without one."""

    def write(text: str = SMALL, name: str = "small") -> Path:
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        return path

    return write
