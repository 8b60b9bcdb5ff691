"""Water at rest in a tank: pressure by depth, weight on the floor, compression, volume, and whether it boils."""

import math

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.probe import Pressure, row

WINDOW = 0.5
"""[s] Pressure and force are means over this time, at the end of the run."""
SETTLED = 1.0
"""[s] By then the lattice has closed up at its surface, and volume and energy are held against what they are."""


def measure(world) -> dict[str, float]:
    """Figures of the run's end; lengths of time from [run] duration.

    error        rms over heights a spacing apart, farther than H from floor and surface, of p/(rho g (H0 - z)) - 1;
                 p the mean stress (see Pressure) over WINDOW, interpolated by a kernel of support H as SPH reads any
                 field; H0 the depth that the water's mass fills
    error_raw    the same of the method's own rho^2 kappa
    floor        force of the water on all solids against its weight, over WINDOW
    compression  mean of max(rho/rho0 - 1, 0) over all water and the time after SETTLED
    volume       largest change of the height of the centre of mass after SETTLED
    boiling      kinetic energy of the last second over that of the second after SETTLED
    speed        rms, at the end [m/s]
    """
    probe, weight = Pressure(world), row(world, "mass").sum() * -world.config.space.gravity[2]
    end, rest = world.config.run.duration, world.config.fluid.liquid.rest_density
    z, p, response, forces, centre, energy, dense = [], [], [], [], [], [], []
    while world.clock.time < end - 1e-9:
        ended = world.step()
        if world.clock.time > end - WINDOW:
            p.append(probe.read())
            z.append(row(world, "x")[:, 2])
            forces.append(-probe.on_solids()[2] / weight)
        if ended and world.clock.time > SETTLED:
            energy.append((world.clock.time, (row(world, "v") ** 2).sum(1).mean()))
            dense.append(np.maximum(row(world, "density") / rest - 1.0, 0.0).mean())
            centre.append(row(world, "x")[:, 2].mean())
            response.append(_inner(world, probe.response()))
    time, energy = np.array(energy).T
    raw = _error(world, np.concatenate(z), np.concatenate(p), weight)
    stress = _error(world, np.concatenate(z), np.concatenate(p) * np.mean(response), weight)
    first, last = energy[time < SETTLED + 1.0].mean(), energy[time > end - 1.0].mean()
    return {
        "error": stress,
        "error_raw": raw,
        "response": np.mean(response),
        "floor": np.mean(forces) - 1.0,
        "compression": np.mean(dense),
        "volume": np.max(np.abs(np.array(centre) / centre[0] - 1.0)),
        "boiling": last / first,
        "speed": math.sqrt(last),
    }


def _tank(world) -> tuple[float, float, float]:
    """Base area [m^2], depth of the water at rho0 [m] and support radius H [m]."""
    side, fluid, space = world.config.solid["tank"].size, world.config.fluid, world.config.space
    area = side[0] * (space.high[1] - space.low[1] if "y" in space.periodic else side[1])
    return area, row(world, "mass").sum() / (fluid.liquid.rest_density * area), fluid.support_radius


def _inner(world, values: np.ndarray) -> float:
    """Mean over the water beyond the reach of walls and surface."""
    x, (_, depth, reach) = row(world, "x"), _tank(world)
    walled = x[:, [k for k in (0, 1) if "xy"[k] not in world.config.space.periodic]]
    half = 0.5 * world.config.solid["tank"].size[0] - reach
    inner = (np.abs(walled).max(1) < half) & (x[:, 2] > reach) & (x[:, 2] < depth - reach)
    return float(values[inner].mean())


def _error(world, z: np.ndarray, p: np.ndarray, weight: float) -> float:
    area, depth, reach = _tank(world)
    dx = world.config.fluid.spacing
    shares = []
    for height in np.arange(reach, depth - reach + 1e-9, dx):
        near = np.abs(z - height) < reach
        q = np.abs(z[near] - height) / reach
        w = (1.0 - q) ** 4 * (1.0 + 4.0 * q)
        shares.append((w @ p[near]) / (w @ (weight / area * (1.0 - z[near] / depth))))
    return float(np.sqrt(np.mean((np.array(shares) - 1.0) ** 2)))


def _point(support: float, spacing: str, duration: str, error: float) -> Point:
    texts = (f"fluid.support={support:g}", f"fluid.spacing={spacing}", f"run.duration={duration}")
    return Point(texts, bounds={"error": error})


def _slab(support: float, width: int, error: float) -> Point:
    """A slice of the tank, `width` particles wide, that closes on itself along y: two walls and a floor."""
    dx = 0.1 / width
    half = support * dx
    texts = (
        f"fluid.support={support:g}",
        f"fluid.spacing={dx!r}",
        "run.duration=2.5 s",
        'space.periodic=["y"]',
        f"space.low=[-0.07, {-half!r}, -0.02]",
        f"space.high=[0.07, {half!r}, 0.2]",
        f"fluid.block.water.low=[-0.05, {-half!r}, 0.0]",
        f"fluid.block.water.high=[0.05, {half!r}, 0.1]",
    )
    return Point(texts, bounds={"error": error})


# Walls carry no stress along themselves, so the layer before them bears 0.127 dx (support 2) less than its width, and
# the rest of the water that much more: 4 x 0.127 dx/W = 5.1 % at dx = W/10, 2.5 % at W/20. A slice has two of the four
# walls and fewer particles.
CASE = Case(
    name="still_tank",
    scene="still_tank",
    reference="hydrostatics, p = rho g (H0 - z)",
    bounds={"error": 0.04, "floor": 0.005, "compression": 0.001, "volume": 0.005, "boiling": 1.0},
    measure=measure,
    full=(_point(2.0, "5 mm", "10 s", 0.04), _slab(3.0, 20, 0.02)),
    quick=(_point(2.0, "10 mm", "2.5 s", 0.06),),
)
