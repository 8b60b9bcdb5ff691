"""The one ti.init of a process, for simulating and for drawing alike."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import textwrap
import time
from pathlib import Path
from types import SimpleNamespace

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")

import taichi as ti  # noqa: E402  (the header must be silenced first)

from sim import launch  # noqa: E402
from sim.errors import ConfigError, RunError  # noqa: E402

ARCHS = ("cpu", "cuda", "vulkan", "metal")
TURNS = 512
"""Turns of a parallel loop that Taichi gives a thread in a go, whatever block_dim says (1.7.4, measured). A loop over
fewer, heavier things runs on one thread: let it run TURNS times as far and act each TURNS-th time."""
_started: dict | None = None


def cache_folder() -> Path:
    """Where compiled kernels are kept between processes."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "seep" / "kernels"


def start(arch: str = "cpu", threads: int | None = None, precision: str = "f32", debug: bool = False) -> dict:
    """Start Taichi once and return the settings in force (arch, threads, precision, debug).

    A second start in the same process is refused: fields of the first would dangle (a segfault, not an error).
    """
    global _started
    threads = threads or cores()
    wanted = {"arch": arch, "threads": threads, "precision": precision, "debug": debug}
    if _started is not None:
        raise RunError(f"Taichi already runs with {_started}; one World a process")
    if arch not in ARCHS:
        raise ConfigError(f"--arch = {arch}: choose from {', '.join(ARCHS)}")
    if precision not in ("f32", "f64"):
        raise ConfigError(f"--precision = {precision}: choose f32 or f64")
    _clear_stale_lock()
    real = ti.f64 if precision == "f64" else ti.f32
    others = _thread_ids()
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # it announces its arch with a bare print
            _init(arch, real, threads, debug)
    except RuntimeError as error:
        raise RunError(f"--arch = {arch}: not to be had on this machine; use --arch cpu") from error
    _give_each_a_processor(sorted(_thread_ids() - others)[-threads:])
    _read_sources_once()
    if not debug:
        _skip_error_positions()
        launch.quicken()
    _started = wanted
    return wanted


def _init(arch: str, real, threads: int, debug: bool) -> None:
    ti.init(
        arch=getattr(ti, arch),
        default_fp=real,
        default_ip=ti.i32,
        cpu_max_num_threads=threads,
        offline_cache=True,
        offline_cache_file_path=str(cache_folder()),
        cfg_optimization=False,  # LLVM does it again anyway: kernels run no slower, the cloth compiles 10 times faster
        fast_math=False,  # NaN tests must hold, and 1/x must not differ between loops
        debug=debug,
        log_level=ti.ERROR,
        enable_fallback=False,
    )


def _thread_ids() -> set[int]:
    """Of this process, where the system tells (Linux)."""
    tasks = Path("/proc/self/task")
    return {int(task.name) for task in tasks.iterdir()} if tasks.is_dir() else set()


def _give_each_a_processor(workers: list[int]) -> None:
    """Tie each of Taichi's workers (its youngest threads) to a processor of its own, if they take up all there are.

    Linux often wakes all of them on one, and moves them when the loop is over: a step of 17,576 particles took 13 ms
    on 2 processors, and takes 11 tied.
    """
    processors = sorted(os.sched_getaffinity(0)) if workers else []
    if 1 < len(workers) == len(processors):
        for worker, processor in zip(workers, processors):
            with contextlib.suppress(OSError):  # refused, or the thread has gone: as it was
                os.sched_setaffinity(worker, {processor})


def stop() -> None:
    """End Taichi, which writes the compiled kernels to the cache; left to the interpreter's end, it may not."""
    if _started is not None:
        ti.reset()


def cores() -> int:
    """Processors that this process may use: not all that there are, where it is tied to some or given a share."""
    tied = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        share, period = Path("/sys/fs/cgroup/cpu.max").read_text().split()
        return max(1, min(tied, round(int(share) / int(period))))
    except (OSError, ValueError):  # no such file, or "max"
        return tied


def few(turns: int) -> bool:
    """Is a loop of this many light turns (5 ns) faster on one thread? Waking the others costs 20 to 80 us each time.
    There, what only copies or compares a row is a fifth of a turn to half of one: the compiler sees the loop whole.

    Loop over a range, then: one over a field's entries does not heed loop_config(serialize=True) (Taichi 1.7.4).
    """
    return _started is not None and _started["arch"] == "cpu" and turns < 20_000


def many(particles: int, sheet: bool) -> bool:
    """Is it worth some work to read each pair of them only once? It asks for rows sorted along the water's longest
    axis, in which the search for a sheet takes a tenth longer."""
    least = 40_000 if sheet else 10_000
    return _started is not None and _started["arch"] == "cpu" and particles >= least


def fours(size: int) -> ti.MatrixField:
    """A field of vectors of four, each of which the compiler loads and stores at once. In a tree of its own it begins
    on a page: in one with others, vectors may lie across cache lines, and a sweep takes a fifth longer."""
    tree, field = ti.FieldsBuilder(), ti.Vector.field(4, float)
    tree.dense(ti.i, size).place(field)
    tree.finalize()
    return field


def running() -> dict | None:
    """The settings of `start`, or None before it."""
    return _started


def _skip_error_positions() -> None:
    """Taichi quotes the source of every syntax node as it compiles, half of a kernel's start; only errors need it."""
    from taichi.lang.ast import ast_transformer_utils

    ast_transformer_utils.ASTTransformerContext.get_pos_info = lambda self, node: ""


def _read_sources_once() -> None:
    """Taichi looks a function's source up, and reflows it, each time another one calls it: a third of a start."""
    from taichi.lang import kernel_impl

    kernel_impl.getsourcefile = functools.cache(kernel_impl.getsourcefile)
    kernel_impl.getsourcelines = functools.cache(kernel_impl.getsourcelines)
    kernel_impl.textwrap = SimpleNamespace(dedent=textwrap.dedent, fill=lambda line, **how: line.rstrip())


def _clear_stale_lock() -> None:
    """A lock left by a killed process silently stops all caching."""
    folder = cache_folder()
    old = time.time() - 120.0  # a live lock is held for well under a second
    if folder.is_dir():
        for lock in folder.rglob("*.lock"):
            with contextlib.suppress(FileNotFoundError):  # its owner was done first
                if lock.stat().st_mtime < old:
                    lock.unlink()
