"""Start-up of flow between plates that hold the water."""

import numpy as np

from sim.studies.case import Case, Point
from sim.world import World

TIMES = (0.0225, 0.045, 0.1125, 0.225, 0.5)
"""[s] As Morris, Fox & Zhu 1997 draw them, and when the flow is steady to 1 %."""
TERMS = 200


def poiseuille(y: np.ndarray, t: float, push: float, nu: float, gap: float) -> np.ndarray:
    """u(y, t) = g/(2 nu) y (L - y) - sum_n 4 g L^2/(nu (pi k)^3) sin(pi k y/L) exp(-(pi k/L)^2 nu t), k = 2 n + 1.

    Morris, Fox & Zhu 1997, eq. 21 [m/s].
    """
    k = np.pi * (2.0 * np.arange(TERMS)[:, None] + 1.0)
    waves = 4.0 * push * gap**2 / (nu * k**3) * np.sin(k * y / gap) * np.exp(-((k / gap) ** 2) * nu * t)
    return push / (2.0 * nu) * y * (gap - y) - waves.sum(0)


def couette(y: np.ndarray, t: float, slide: float, nu: float, gap: float) -> np.ndarray:
    """u(y, t) = V y/L + sum_n 2 V/(n pi) (-1)^n sin(n pi y/L) exp(-(n pi/L)^2 nu t).   Their eq. 19 [m/s]"""
    n = np.arange(1, TERMS + 1)[:, None]
    waves = 2.0 * slide / (n * np.pi) * (-1.0) ** n * np.sin(n * np.pi * y / gap)
    return slide * y / gap + (waves * np.exp(-((n * np.pi / gap) ** 2) * nu * t)).sum(0)


def _across(count: int) -> tuple[str, ...]:
    """Settings for so many particles from plate to plate, in a slab of just two support radii."""
    dx = 1e-3 / count
    high = f"[{6 * dx}, 1e-3, {6 * dx}]"
    return (
        f"fluid.spacing={dx}",
        f"space.high=[{6 * dx}, 1.5e-3, {6 * dx}]",
        f"fluid.block.gap.high={high}",
    )


def measure(world: World, times: tuple[float, ...] = TIMES) -> dict[str, float]:
    """Largest |u - exact| of any particle over the fastest exact u, at each of `times`, and over all of them."""
    config = world.config
    push, slide = config.space.gravity[0], config.solid["lid"].slide[0]
    gap, nu = config.solid["lid"].point[1], config.fluid.liquid.nu
    figures = {}
    for time in times:
        while world.clock.time < time - 1e-9:
            frame = world.advance()
        y, u = (a.astype(np.float64) for a in (frame.fluid_x[:, 1], frame.fluid_v[:, 0]))
        exact = couette(y, frame.time, slide, nu, gap) if slide else poiseuille(y, frame.time, push, nu, gap)
        figures[f"error_at_{time:g}_s"] = float(np.abs(u - exact).max() / np.abs(exact).max())
    return {"error": max(figures.values()), **figures}


CASE = Case(
    name="poiseuille",
    scene="poiseuille",
    reference="u(y, t) of Morris, Fox & Zhu 1997, eq. 21",
    bounds={"error": 0.02},
    measure=measure,
    full=(Point((*_across(40), "run.fps=400"), "f64"),),
    quick=(Point((*_across(20), "run.fps=400"), "f64", {"error": 0.025}),),
)
