"""What every test shares: Taichi's greeting off, scene files made on the spot."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

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


@pytest.fixture
def scene_file(tmp_path: Path):
    """scene_file(text) -> path of a scene with that text; the small cloth-only scene without one."""

    def write(text: str = SMALL, name: str = "small") -> Path:
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        return path

    return write
