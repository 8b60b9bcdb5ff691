"""Clips that move: what each holds, and the path on which it carries it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.scene.cloth import Sheet
from sim.scene.course import Course
from sim.scene.hang import clip_nodes
from sim.shapes import rotation


@dataclass(frozen=True)
class Grip:
    """nodes (k,), x (k, 3) where they are at t = 0 [m], the course, the point that it turns about [m], the force that
    it gives way to [N] (None: to none), and the axis along which it does, if it turns."""

    nodes: np.ndarray
    x: np.ndarray
    course: Course
    pivot: np.ndarray
    force: float | None
    along: np.ndarray | None

    def place(self, time: float) -> np.ndarray:
        """(k, 3) places at a time of its path [m]."""
        shift, angle = self.course.place(time)
        return self.pivot + shift + (self.x - self.pivot) @ np.array(rotation(self.course.axis, angle)).T


def build_grips(cloth: Any, sheet: Sheet) -> list[Grip]:
    """One for each pin with a path."""
    grips = []
    for name, pin in cloth.pins.items():
        if pin.path:
            nodes = np.flatnonzero(clip_nodes({name: pin}, sheet.uv, sheet.shape) >= 0)
            x = sheet.x[nodes]
            pivot = np.array(pin.path.centre) if pin.path.centre else x.mean(0)
            course = Course(pin.path)
            grips.append(Grip(nodes, x, course, pivot, pin.force, course.axis if pin.path.angle else None))
    return grips
