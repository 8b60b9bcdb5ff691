"""One row's worth of a study: a scene, what is laid over it, what is measured on it, and how far off that may be."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Point:
    """One run of a case: what is laid over its scene, as --set would, and in which precision."""

    overrides: tuple[str, ...] = ()
    precision: str = "f32"


@dataclass(frozen=True)
class Case:
    """What a scene must come to.

    scene       a name in configs/scenes
    reference   what it is held against, with its source
    bounds      figure -> largest absolute value allowed; the figure "error" is the one that charts draw
    measure     World at t = 0 -> figures by name; run in a process of its own
    full, quick the points of `chart --check`, and of --quick
    """

    name: str
    scene: str
    reference: str
    bounds: dict[str, float]
    measure: Callable[[Any], dict[str, float]]
    full: tuple[Point, ...]
    quick: tuple[Point, ...]


def run_point(case: Case, point: Point, threads: int = 0) -> dict[str, Any]:
    """Figures of one point, run in a fresh process, with what it cost.

    Adds seconds_per_simulated_second, steps, iterations, particles. Errors of the run (a divergence, say) are raised.
    """
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_run, (case, point, threads))


def _run(case: Case, point: Point, threads: int) -> dict[str, Any]:
    from sim import registry, runtime
    from sim.config import load
    from sim.world import World

    runtime.start(threads=threads or None, precision=point.precision)
    registry.discover()
    world = World(load(case.scene, overrides=[f'run.precision="{point.precision}"', *point.overrides]))
    began = time.perf_counter()
    figures = dict(case.measure(world))
    seconds = sum(world.seconds.values()) or time.perf_counter() - began
    figures["seconds_per_simulated_second"] = seconds / max(world.clock.time, 1e-12)
    figures |= {"steps": world.clock.step, "iterations": world.iterations}
    figures["particles"] = int(world.state.count[None]) if world.config.fluid else 0
    runtime.stop()
    return figures
