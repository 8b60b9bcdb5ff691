"""What the clips carry, and what the water presses with on each place of the sheet, as means over a time."""

from dataclasses import replace
from typing import Any

import numpy as np


class Load:
    """Watches a world's cloth stage. Steps between `begin` and the readings count.

    carried()   force of the clips on cloth and water [N] (3,)
    pressure()  contact impulse over area and time at each node, both faces [Pa] (n,)
    places()    mean place of each node [m] (n, 3)
    momentum()  of water and free cloth now [kg m/s] (3,)
    """

    def __init__(self, world: Any):
        self.world, self.watching = world, False
        index = next(k for k, stage in enumerate(world.stages) if stage.slot == "cloth")
        self._cloth = world.stages[index].run
        world.stages[index] = replace(world.stages[index], run=self._run)
        self.begin()
        self.watching = False

    def begin(self) -> None:
        """From here on."""
        nodes = self._read("cloth.inv_mass").shape[0]
        self.watching, self.time = True, 0.0
        self.impulse, self.push, self.x = np.zeros(3), np.zeros(nodes), np.zeros((nodes, 3))

    def carried(self) -> np.ndarray:
        """What held nodes weigh hangs on the clips too."""
        held = self._read("cloth.inv_mass") == 0.0
        gravity = np.array(self.world.config.space.gravity)
        return self.impulse / self.time - self._read("cloth.mass")[held].sum() * gravity

    def pressure(self) -> np.ndarray:
        """A third of each triangle belongs to each of its corners."""
        return self.push / self.time / node_areas(self.places(), self.world.scene.sheet.triangles)

    def places(self) -> np.ndarray:
        """Over the same time."""
        return self.x / self.time

    def _run(self, dt: float) -> None:
        if not self.watching:
            self._cloth(dt)
            return
        before = self.momentum()
        self._cloth(dt)
        free = self._read("cloth.inv_mass") > 0.0
        weight = self._read("cloth.mass")[free].sum() * np.array(self.world.config.space.gravity)
        self.impulse += self.momentum() - before - dt * weight
        self.push += self._read("cloth.push_front") + self._read("cloth.push_back")
        self.x += dt * self._read("cloth.x")
        self.time += dt

    def momentum(self) -> np.ndarray:
        """Of water and free cloth [kg m/s]."""
        living, free = int(self.world.state.count[None]), self._read("cloth.inv_mass") > 0.0
        water = self._read("fluid.mass")[:living, None] * self._read("fluid.v")[:living]
        return water.sum(0) + (self._read("cloth.mass")[:, None] * self._read("cloth.v"))[free].sum(0)

    def _read(self, name: str) -> np.ndarray:
        return self.world.state[name].to_numpy().astype(np.float64)


def node_areas(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) [m^2]."""
    return np.bincount(triangles.ravel(), np.repeat(_thirds(x, triangles), 3), len(x))


def _thirds(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """A third of the area of each triangle (t,) [m^2]."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0


def under(x: np.ndarray, triangles: np.ndarray, water: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(corners (k, 3), barycentric weights (k, 3)) of the triangle at each particle's place on the sheet seen from
    above; corners are -1 beside it. Of a sheet with overhangs, some triangle."""
    order = np.argsort(water[:, 0], kind="stable")
    across, along = water[order, 0], water[order, 1]
    found, shares = np.full((len(water), 3), -1), np.zeros((len(water), 3))
    for corners in triangles:
        a, b, c = x[corners, :2]
        first, last = np.searchsorted(across, (min(a[0], b[0], c[0]), max(a[0], b[0], c[0])))
        u, v, p, q = b - a, c - a, across[first:last] - a[0], along[first:last] - a[1]
        area = u[0] * v[1] - u[1] * v[0]
        s, t = (p * v[1] - q * v[0]) / area, (u[0] * q - u[1] * p) / area
        over = np.flatnonzero((s >= 0.0) & (t >= 0.0) & (s + t <= 1.0))
        found[order[first + over]] = corners
        shares[order[first + over]] = np.stack([1.0 - s - t, s, t], 1)[over]
    return found, shares


def depth_by_mass(x: np.ndarray, triangles: np.ndarray, water: np.ndarray, mass: np.ndarray, rest: float) -> np.ndarray:
    """h = sum m b/(rho_0 A) at each node (n,) [m]: b the weight of a particle on the sheet seen from above, A a third
    of the node's triangles there. water (k, 3) [m], mass (k,) [kg], rest rho_0 [kg/m^3]."""
    corners, shares = under(x, triangles, water)
    there = corners[:, 0] >= 0
    above = np.bincount(corners[there].ravel(), (shares * mass[:, None])[there].ravel(), len(x))
    return above / (rest * node_areas(x * [1.0, 1.0, 0.0], triangles))


def level(x: np.ndarray, triangles: np.ndarray, volume: float) -> float:
    """Height to which `volume` [m^3] fills the hollow of a sheet: its integral over the sheet's plan, by bisection."""
    edges = 0.5 * (x[triangles] + x[np.roll(triangles, 1, axis=1)])
    plan = _thirds(x * [1.0, 1.0, 0.0], triangles)
    low, high = x[:, 2].min(), x[:, 2].max()
    for _ in range(60):
        middle = 0.5 * (low + high)
        full = (plan[:, None] * np.maximum(middle - edges[:, :, 2], 0.0)).sum() > volume
        low, high = (low, middle) if full else (middle, high)
    return 0.5 * (low + high)
