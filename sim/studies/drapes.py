"""Every fabric card over the same pedestal: what its weight and bending make of it, and how much of it hangs."""

from __future__ import annotations

import multiprocessing
from dataclasses import replace
from typing import Any

import numpy as np

from sim import config
from sim.schema import Fabric

SCENE = "fabrics"
SETTINGS = ("run.fps=10",)
CELL = 1e-3
"""[m] Shadows are counted in squares of this side."""
SHRUNK = 0.985
"""[1] The pedestal as it is drawn: between two nodes, a sheet of flat triangles cuts its sharp rim."""


def cards() -> list[tuple[str, Fabric]]:
    """(name, card), the lightest first."""
    found = [(name, config.card("fabrics", name, Fabric)) for name in config.names("fabrics")]
    return sorted(found, key=lambda pair: pair[1].area_density)


def words(name: str, card: Fabric, coefficient: float) -> str:
    """Two lines that say what it is, and how it drapes."""
    return (
        f"{name}: {1e3 * card.area_density:.0f} g/m$^2$, bending {1e6 * card.bending:.2g} \u00b5N m\n"
        f"drape coefficient {100.0 * coefficient:.0f} %"
    )


def hang(name: str, draw: Any) -> tuple[Any, float]:
    """(what `draw(frame, static)` makes of the card's sheet at the scene's end, its drape coefficient), in a process
    of its own."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return pool.apply(_hung, (name, draw))


def _hung(name: str, draw: Any) -> tuple[Any, float]:
    from sim import registry, runtime
    from sim.world import World

    runtime.start()
    registry.discover()
    world = World(config.load(SCENE, [f'cloth.fabric.card="{name}"', *SETTINGS]))
    while world.frame_index < world.frame_count:
        frame = world.advance()
    size, radius = world.config.cloth.size, world.config.solid["pedestal"].radius
    found = coefficient(frame.cloth_x, np.asarray(world.scene.sheet.triangles), size[0] * size[1], np.pi * radius**2)
    static = world.static
    return draw(frame, replace(static, solid_x=static.solid_x * np.float32([SHRUNK, SHRUNK, 1.0]))), found


def coefficient(x: np.ndarray, triangles: np.ndarray, sheet: float, support: float) -> float:
    """(shadow - support)/(sheet - support), areas [m^2]; shadow: of places x (n, 3) seen from above.   Cusick 1968

    1 hangs nowhere, 0 hangs straight down.
    """
    corners = x[triangles][:, :, :2].astype(np.float64)
    side = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    n = int(np.ceil(1.5 * side / CELL)) + 1
    weights = np.array([(i, j, n - i - j) for i in range(n + 1) for j in range(n + 1 - i)]) / n
    cells = np.floor(np.einsum("wk,tkd->twd", weights, corners).reshape(-1, 2) / CELL).astype(np.int64)
    cells -= cells.min(0)
    shadow = len(np.unique(cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1])) * CELL**2
    return float((shadow - support) / (sheet - support))
