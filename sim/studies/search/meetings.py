"""Water that meets cloth, made by formula: the same at every size, so that searches can be timed without simulating."""

from typing import NamedTuple

import numpy as np

SIDE = 1.0
"""[m] Of the sheet, at rest."""
FRAMES = 6
"""Of a moving sheet; between two of them a node moves by up to `SWAY` patches, and water by up to `PATH`."""
SWAY, PATH = 0.25, 0.5


class Meeting(NamedTuple):
    """A square sheet of side x side patches and water about it.

    nodes      (FRAMES, side + 1, side + 1, 3) [m]
    x, x1      (n, 3) where water is and where it goes, sorted by cells as a fluid solver sorts it [m]
    """

    nodes: np.ndarray
    x: np.ndarray
    x1: np.ndarray

    @property
    def patch(self) -> float:
        """[m] Edge of a patch at rest."""
        return SIDE / (self.nodes.shape[1] - 1)

    def boxes(self, frame: int, grown: float) -> tuple[np.ndarray, np.ndarray]:
        """(low, high) of the patches, row by row, (m, 3) f32, each `grown` [m] on every side."""
        p = self.nodes[frame]
        corners = np.stack([p[:-1, :-1], p[1:, :-1], p[:-1, 1:], p[1:, 1:]])
        low, high = corners.min(0).reshape(-1, 3) - grown, corners.max(0).reshape(-1, 3) + grown
        return low.astype(np.float32), high.astype(np.float32)


def meeting(kind: str, patches: int, points: int) -> Meeting:
    """`kind` of KINDS with about so many patches and exactly so many points."""
    random = np.random.default_rng(11)
    side = round(np.sqrt(patches))
    patch = SIDE / side
    u, v = np.meshgrid(*[np.linspace(0.0, SIDE, side + 1)] * 2, indexing="ij")
    still, water = KINDS[kind](u, v, points, patch, random)
    away = np.stack([np.sin(7.0 * v + 2.0 * u), np.cos(5.0 * u - v), np.sin(6.0 * u) * np.cos(4.0 * v)], -1)
    nodes = still + SWAY * patch * np.arange(FRAMES)[:, None, None, None] * away
    cell = np.floor(water / (2.0 * patch)).astype(int)
    water = water[np.lexsort((cell[:, 0], cell[:, 1], cell[:, 2]))]
    return Meeting(nodes, water, water + PATH * patch * random.uniform(-1.0, 1.0, water.shape))


def _stretched(u, v, points, patch, random):
    """A pool on a sheet drawn flat, four patches deep however many particles it is cut into."""
    x = random.uniform(0.0, SIDE, (points, 3)) * [1.0, 1.0, 4.0 * patch / SIDE]
    return np.stack([u, v, _swell(u, v)], -1), x + np.stack([0 * x[:, 0], 0 * x[:, 0], _swell(x[:, 0], x[:, 1])], -1)


def _swell(u, v):
    return 0.03 * np.sin(6.0 * u) * np.cos(5.0 * v)


def _crumpled(u, v, points, patch, random):
    """A sheet in folds over each other, water all through the heap."""
    waves, phases = random.normal(0.0, 9.0, (3, 12, 2)), random.uniform(0.0, 2.0 * np.pi, (3, 12))
    folds = np.sin(np.einsum("akc,cij->akij", waves, np.stack([u, v])) + phases[:, :, None, None]).sum(1) / 50.0
    heap = np.moveaxis(folds, 0, -1) + np.stack([0.2 * u, 0.2 * v, 0.0 * u], -1)
    low, high = heap.min((0, 1)), heap.max((0, 1))
    return heap, random.uniform(low, high, (points, 3))


def _splash(u, v, points, patch, random):
    """A crown and drops over a flat sheet: most water far from it."""
    angle, radius = random.uniform(0.0, 2.0 * np.pi, points), 0.3 + 0.02 * random.normal(size=points)
    crown = np.stack([0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle), 0.2 * random.random(points)], -1)
    drops = random.uniform([0.0, 0.0, 0.0], [SIDE, SIDE, 0.5], (points, 3))
    return np.stack([u, v, 0.0 * u], -1), np.where(random.random((points, 1)) < 0.5, crown, drops)


def _jet(u, v, points, patch, random):
    """A jet on the middle of a dented sheet: much water, few patches."""
    radius, angle = 0.03 * np.sqrt(random.random(points)), random.uniform(0.0, 2.0 * np.pi, points)
    jet = np.stack([0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle), 0.5 * random.random(points)], -1)
    dent = -0.1 * np.exp(-40.0 * ((u - 0.5) ** 2 + (v - 0.5) ** 2))
    return np.stack([u, v, dent], -1), jet - [0.0, 0.0, 0.1]


KINDS = {"stretched": _stretched, "crumpled": _crumpled, "splash": _splash, "jet": _jet}
"""By name: (u, v, points, patch, random) -> nodes of the sheet and water."""
