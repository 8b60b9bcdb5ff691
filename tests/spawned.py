"""One scene, one process, one run: Taichi starts once a process, so a scene's run is spawned and its figures shared."""

import multiprocessing
from collections.abc import Callable
from typing import Any

LIMIT = 600
"""[s] A run that takes longer than this hangs."""


def spawn(function: Callable, *args: Any, **kwargs: Any) -> Any:
    """function(*args, **kwargs) in a fresh process; its picklable result. The function must be a module's own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply_async(function, args, kwargs).get(LIMIT)


def open_world(scene: str, *overrides: str, quick: bool = False, threads: int = 1, precision: str = "f32"):
    """A World at t = 0 in this process, which must be a fresh one. One thread: two tests run side by side."""
    from sim import registry, runtime
    from sim.config import load
    from sim.world import World

    runtime.start(threads=threads, precision=precision)
    registry.discover()
    return World(load(scene, overrides=[f'run.precision="{precision}"', *overrides], quick=quick))
