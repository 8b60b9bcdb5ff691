"""The live window: Taichi's GUI shows pictures as they are made; it is handed callables and knows no simulation."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import taichi as ti

from render.draw import Look
from render.image import write_png
from sim.errors import RunError
from sim.frame import Frame, Static

ORBIT = math.radians(180.0)
"""Turn of the camera [rad] for a drag across the whole window."""
STEEPEST = math.radians(85.0)
"""Highest and lowest the camera goes above the horizon: straight down has no up."""


@dataclass
class Orbit:
    """A camera on a sphere round its target: azimuth and height [rad], distance [m]."""

    look: Look

    def __post_init__(self) -> None:
        self.target = np.array(self.look.target, float)
        arm = np.array(self.look.eye, float) - self.target
        self.distance = float(np.linalg.norm(arm))
        self.azimuth, self.height = math.atan2(arm[1], arm[0]), math.asin(arm[2] / self.distance)

    def turn(self, across: float, up: float) -> None:
        """By a drag, in widths and heights of the window."""
        self.azimuth -= across * ORBIT
        self.height = min(max(self.height - up * ORBIT, -STEEPEST), STEEPEST)

    def nearer(self, factor: float) -> None:
        """Multiply the distance."""
        self.distance *= factor

    def now(self) -> Look:
        """The look from where the camera stands."""
        flat = math.cos(self.height)
        arm = np.array([flat * math.cos(self.azimuth), flat * math.sin(self.azimuth), math.sin(self.height)])
        return replace(self.look, eye=tuple((self.target + self.distance * arm).tolist()))


def live(
    step: Callable[[], Frame | None],
    reset: Callable[[], Frame],
    draw: Callable[[Frame, Look, Static], np.ndarray],
    look: Look,
    static: Static,
    title: str,
    capture: Path | None = None,
    pictures: int | None = None,
) -> int:
    """Show a run as it happens; returns the number of pictures shown.

    step() gives the next frame, None after the last; reset() the first. Drag orbits, the arrow keys up and down go
    nearer and away, space pauses, s steps, r resets, escape leaves. With `capture` the same window stays unseen, each
    picture is written there as NNNNNN.png, and it leaves after the last frame, or after so many `pictures`.
    """
    if capture is None and not display():
        raise RunError("no display here to open a window on; use --capture DIR")
    gui = ti.GUI(title, res=look.size, show_gui=capture is None, fast_gui=False)
    if capture:
        capture.mkdir(parents=True, exist_ok=True)
    orbit, frame, grip, shown = Orbit(look), reset(), None, 0
    keys = Keys()
    while gui.running:
        pixels = draw(frame, orbit.now(), static)
        gui.set_image(np.ascontiguousarray(pixels[::-1].swapaxes(0, 1)))
        if capture:
            write_png(capture / f"{shown:06d}.png", _seen(gui))
        gui.show()
        shown += 1
        if shown == pictures:
            break
        if capture is None:
            keys.read(gui, orbit)
            grip = _drag(gui, orbit, grip)
        if keys.reset:
            frame = reset()
        elif keys.step or not keys.paused:
            following = step()
            if following is None and capture:
                break
            frame, keys.paused = following or frame, keys.paused or following is None
    gui.close()
    return shown


@dataclass
class Keys:
    """What the keyboard asks for; step and reset hold for one round of the loop."""

    paused: bool = False
    step: bool = False
    reset: bool = False

    def read(self, gui: ti.GUI, orbit: Orbit) -> None:
        """Take what was pressed since the last round."""
        self.step = self.reset = False
        for event in gui.get_events(ti.GUI.PRESS):
            if event.key in (ti.GUI.ESCAPE, ti.GUI.EXIT):
                gui.running = False
            elif event.key == ti.GUI.SPACE:
                self.paused = not self.paused
            elif event.key == "s":
                self.paused = self.step = True
            elif event.key == "r":
                self.reset = True
            elif event.key in (ti.GUI.UP, ti.GUI.DOWN):
                orbit.nearer(0.9 if event.key == ti.GUI.UP else 1.1)


def display() -> bool:
    """Whether a window can be opened."""
    return platform.system() != "Linux" or bool(os.environ.get("DISPLAY"))


def _drag(gui: ti.GUI, orbit: Orbit, grip: tuple[float, float] | None) -> tuple[float, float] | None:
    """Turn the camera while the left button is down; returns where the cursor holds it."""
    if not gui.is_pressed(ti.GUI.LMB):
        return None
    cursor = gui.get_cursor_pos()
    if grip:
        orbit.turn(cursor[0] - grip[0], cursor[1] - grip[1])
    return cursor


def _seen(gui: ti.GUI) -> np.ndarray:
    """What the window holds, uint8 (h, w, 3)."""
    image = np.clip(gui.get_image()[..., :3], 0.0, 1.0)
    return np.ascontiguousarray((255.0 * image + 0.5).astype(np.uint8).swapaxes(0, 1)[::-1])
