"""One row's worth of a study: a scene, what is laid over it, what is measured on it, and how far off that may be."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from sim.errors import CapacityError, SeepError


@dataclass(frozen=True)
class Point:
    """One run of a case: what is laid over its scene, as --set would, in which precision, and bounds of its own."""

    overrides: tuple[str, ...] = ()
    precision: str = "f32"
    bounds: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """What a scene must come to.

    scene       a name in configs/scenes
    reference   what it is held against, with its source
    bounds      figure -> largest absolute value allowed; the figure "error" is the one that charts draw
    measure     World at t = 0 -> figures by name; run in a process of its own
    full, quick the points of `chart --check`, and of --quick
    prepare     what is added to the World before its first step; kernels are compiled with it
    """

    name: str
    scene: str
    reference: str
    bounds: dict[str, float]
    measure: Callable[[Any], dict[str, float]]
    full: tuple[Point, ...]
    quick: tuple[Point, ...]
    prepare: Callable[[Any], None] | None = None


def run_point(case: Case, point: Point, threads: int = 0) -> dict[str, Any]:
    """Figures of one point, run in a fresh process, with what it cost (see `cost`).

    Errors of the run are raised; those of physics and capacity carry the cost up to there as `error.cost`.
    """
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=_answer, args=(theirs, case, point, threads), daemon=True)
    child.start()
    theirs.close()
    try:
        answer = ours.recv()
    except EOFError:
        child.join()
        raise CapacityError(f"{case.name}: its process ended with {child.exitcode}; out of memory, it seems") from None
    finally:
        child.terminate()
        child.join()
    if isinstance(answer, BaseException):
        raise answer
    return answer


def cost(world: Any) -> dict[str, Any]:
    """What a run has cost: seconds_per_simulated_second, dt (mean) [s], steps, iterations, particles, peak_memory [B].

    Kernels are compiled before the clock starts, so these are the seconds of the method. A case that measures one of
    them itself has the last word.
    """
    simulated, steps = world.clock.time, world.clock.step
    return {
        "seconds_per_simulated_second": sum(world.seconds.values()) / simulated if simulated else 0.0,
        "dt": simulated / max(steps, 1),
        "steps": steps,
        "iterations": world.iterations,
        "particles": int(world.state.count[None]) if world.config.fluid else len(world.scene.sheet.x),
        "peak_memory": _peak_memory(),
    }


def _answer(pipe, case: Case, point: Point, threads: int) -> None:
    """The child: its figures, or the exception that ended it, through the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    try:
        answer = _run(case, point, threads)
    except BaseException as error:
        error.add_note(traceback.format_exc())
        answer = error
    pipe.send(answer)
    pipe.close()


def _end_with_parent() -> None:
    """A chart that was killed leaves no run behind."""
    multiprocessing.parent_process().join()
    os._exit(1)


def _run(case: Case, point: Point, threads: int) -> dict[str, Any]:
    from sim import registry, runtime
    from sim.config import load
    from sim.world import World

    runtime.start(threads=threads or None, precision=point.precision)
    registry.discover()
    world = World(load(case.scene, overrides=[f'run.precision="{point.precision}"', *point.overrides]))
    if case.prepare:
        case.prepare(world)
    start = world.save()
    world.step()
    world.load(start)
    world.seconds.clear()
    try:
        figures = {name: float(value) for name, value in case.measure(world).items()}
    except SeepError as error:
        error.cost = cost(world)
        raise
    figures = cost(world) | figures
    runtime.stop()
    return figures


def _peak_memory() -> int:
    """Largest resident set of this process so far [B]; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:
        return 0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
