"""[fluid], [emitter.*], [drain.*] -> the water that is there, the streams that come, and how much there can be."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.constants import MASS_UNIT
from sim.errors import CapacityError, ConfigError
from sim.scene.clearance import clearance
from sim.scene.solids import Solids

FEMTO = 10**15
"""Streams keep time in whole femtoseconds, so that what has come by then follows from the time alone."""
SPARE = 0.05
SPARE_WETTING = 0.25
"""Share of particles beyond those expected: drops that leave the cloth while others still soak in."""
CLEARANCE = 0.4
"""[dx] A block leaves out what is nearer than this to a solid, or inside: water at rest stands at 0.5."""


@dataclass(frozen=True)
class Stream:
    """One emitter. Layers of `points` (n, 3) [m] leave at `velocity` [m/s] every `interval` [fs], from `start` to
    `stop`, `total` particles in all (the last layer may be part of one); again every `period` [fs] (0: once)."""

    points: np.ndarray
    velocity: np.ndarray
    start: int
    interval: int
    total: int
    period: int

    def emitted(self, time: float) -> int:
        """Particles that have come by `time` [s]."""
        t = round(time * FEMTO)
        rounds, t = divmod(t, self.period) if self.period else (0, t)
        layers = (t - self.start) // self.interval + 1 if t >= self.start else 0
        return rounds * self.total + min(self.total, layers * len(self.points))


@dataclass(frozen=True)
class Water:
    """x, v (n, 3) of the bodies at t = 0; units: mass of a particle [MASS_UNIT]; capacity: particles there can be."""

    x: np.ndarray
    v: np.ndarray
    units: int
    capacity: int
    streams: tuple[Stream, ...]
    drains: tuple[tuple[tuple, tuple], ...]


def build_water(config: Any, solids: Solids) -> Water:
    """ConfigError for a body thinner than a particle; CapacityError if more water comes than particles_max."""
    fluid = config.fluid
    dx = fluid.spacing
    units = round(fluid.liquid.rest_density * dx**3 / MASS_UNIT)
    bodies = [_lattice(name, block, dx) for name, block in fluid.block.items()]
    bodies += [_shells(name, ball, dx) for name, ball in fluid.ball.items()]
    bodies = [x[clearance(solids.primitives, x) > CLEARANCE * dx] for x in bodies]
    swirls = [block.vortices for block in fluid.block.values()] + [0.0] * len(fluid.ball)
    speeds = [b.velocity + vortices(x, config.space, s) for b, x, s in zip(fluid.bodies, bodies, swirls)]
    x = np.concatenate(bodies) if bodies else np.zeros((0, 3))
    v = np.concatenate(speeds) if speeds else np.zeros((0, 3))
    streams = tuple(_stream(emitter, dx, config.run.duration) for emitter in config.emitter.values())
    expected = len(x) + sum(s.emitted(config.run.duration) for s in streams)
    capacity = fluid.particles_max
    if capacity == "auto":
        capacity = int(expected * (1.0 + (SPARE_WETTING if config.wetting else SPARE))) + 64
    if expected > capacity:
        raise CapacityError(f"fluid.particles_max = {capacity}: {expected} particles will come")
    drains = tuple((tuple(d.low), tuple(d.high)) for d in config.drain.values())
    return Water(x, v, units, capacity, streams, drains)


def vortices(x: np.ndarray, space: Any, speed: float) -> np.ndarray:
    """u = U (-cos a sin b, r sin a cos b, 0): two by two vortices that fill space in x and y, without divergence.

    a = 2 pi x/Lx, b = 2 pi y/Ly, r = Ly/Lx, from the low corner. x (n, 3) -> (n, 3) [m/s].   Taylor & Green 1937
    """
    size = np.subtract(space.high, space.low)
    a, b = (2.0 * np.pi * (x[:, n] - space.low[n]) / size[n] for n in (0, 1))
    u, v = -np.cos(a) * np.sin(b), np.sin(a) * np.cos(b) * size[1] / size[0]
    return speed * np.stack([u, v, np.zeros_like(u)], 1)


def _lattice(name: str, block: Any, dx: float) -> np.ndarray:
    """Cubic lattice, half a spacing from every face that is a whole number of spacings from its opposite."""
    counts = [int(np.floor((b - a) / dx + 0.5)) for a, b in zip(block.low, block.high)]
    if min(counts) < 1:
        raise ConfigError(f"fluid.block.{name}: thinner than one spacing of {dx:g} m")
    axes = [a + (np.arange(n) + 0.5) * dx for a, n in zip(block.low, counts)]
    return np.stack(np.meshgrid(*axes[::-1], indexing="ij"), -1).reshape(-1, 3)[:, ::-1].copy()


def _shells(name: str, ball: Any, dx: float) -> np.ndarray:
    """As many particles as the ball has spacings cubed, on shells a spacing apart, each a golden spiral, stretched.

    Round from the start: a lattice's cut corners would ring for a while.
    """
    count = round(ball.volume / dx**3)
    if count < 1:
        raise ConfigError(f"fluid.ball.{name}: smaller than one particle of {dx:g} m")
    layers = max(round((count * 3.0 / (4.0 * math.pi)) ** (1.0 / 3.0)), 1)
    ends = np.round(count * (np.arange(layers + 1) / layers) ** 3).astype(int)
    shells = [(k + 0.5) / layers * _spiral(n, float(k)) for k, n in enumerate(np.diff(ends))]
    x = np.concatenate(shells)
    return (x - x.mean(0)) * np.array(ball.half_axes) + np.array(ball.centre)


def _spiral(count: int, turn: float) -> np.ndarray:
    """Points all over the unit sphere, equally dense; turned by `turn` [rad]. One alone: its middle."""
    if count == 1:
        return np.zeros((1, 3))
    n = np.arange(count)
    z = 1.0 - (2.0 * n + 1.0) / count
    angle = n * math.pi * (3.0 - math.sqrt(5.0)) + turn
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], 1)


def _stream(emitter: Any, dx: float, duration: float) -> Stream:
    """A disc of the square lattice with the nozzle's area; layers so far apart that the rate comes out exactly."""
    axis = np.array(emitter.direction, float) / np.linalg.norm(emitter.direction)
    area = emitter.rate / emitter.speed
    points = _disc(axis, max(round(area / dx**2), 1)) * dx + np.array(emitter.centre, float)
    stop = emitter.stop if emitter.stop is not None else duration
    return Stream(
        points,
        axis * emitter.speed,
        round(emitter.start * FEMTO),
        round(len(points) * dx**3 / emitter.rate * FEMTO),
        max(round(emitter.rate * (stop - emitter.start) / dx**3), 0),
        round(stop * FEMTO) if emitter.repeat else 0,
    )


def _disc(axis: np.ndarray, count: int) -> np.ndarray:
    """The `count` points of a unit square lattice nearest to a centre in general position, across `axis`."""
    u = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u)
    reach = np.arange(-int(count**0.5) - 2, int(count**0.5) + 3)
    a, b = (g.ravel() + 0.5 for g in np.meshgrid(reach, reach))
    nearest = np.lexsort((b, a, np.round(a * a + b * b, 6)))[:count]
    a, b = a[nearest] - a[nearest].mean(), b[nearest] - b[nearest].mean()
    return a[:, None] * u + b[:, None] * np.cross(axis, u)
