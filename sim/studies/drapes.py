"""Every fabric card over the same pedestal: what its weight, stretch and bending make of it."""

from __future__ import annotations

import multiprocessing
from typing import Any

from sim import config
from sim.schema import Fabric

SCENE = "fabrics"
SETTINGS = ("cloth.spacing=9 mm", "run.fps=10")


def cards() -> list[tuple[str, str]]:
    """(card, two lines that say what it is), the lightest first."""
    found = [(config.card("fabrics", name, Fabric), name) for name in config.names("fabrics")]
    found.sort(key=lambda pair: pair[0].area_density)
    return [(name, _words(card, name)) for card, name in found]


def _words(card: Fabric, name: str) -> str:
    weight, thick = 1e3 * card.area_density, 1e3 * card.thickness
    return (
        f"{name}: {weight:.0f} g/m$^2$, {thick:.2g} mm\nstretch {card.stretch:.0f} N/m, bending {card.bending:.2g} N m"
    )


def hang(name: str, draw: Any) -> Any:
    """What `draw(frame, static)` makes of the card's sheet at the scene's end, in a process of its own."""
    context = multiprocessing.get_context("spawn")
    with context.Pool(1) as pool:
        return pool.apply(_hung, (name, draw))


def _hung(name: str, draw: Any) -> Any:
    from sim import registry, runtime
    from sim.world import World

    runtime.start()
    registry.discover()
    world = World(config.load(SCENE, [f'cloth.fabric.card="{name}"', *SETTINGS]))
    while world.frame_index < world.frame_count:
        frame = world.advance()
    return draw(frame, world.static)
