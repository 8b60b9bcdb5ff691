"""A process of its own that draws frames while the next are simulated."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty

from render.draw import Look, draw
from render.image import write_png
from sim.frame import Static, read

Order = Callable[[Path, Path, Path], None]
"""Asks for a picture: of the scene's static file, a frame's file, and where the PNG goes."""


@contextmanager
def artist(look: Look, begin: Callable[[], object], end: Callable[[], object]) -> Iterator[Order]:
    """Yields an Order; at the end of the block all that was ordered is drawn, unless the block failed.

    begin and end start and stop the process's own Taichi; they are pickled, so no closures.
    """
    context = multiprocessing.get_context("spawn")
    orders = context.Queue()
    process = context.Process(target=_draw, args=(orders, look, begin, end, os.getpid()), daemon=True)
    process.start()
    try:
        yield lambda static, frame, image: orders.put((static, frame, image))
        orders.put(None)
        process.join()
    finally:
        process.terminate()


def _draw(orders, look: Look, begin: Callable, end: Callable, parent: int) -> None:
    """Draw what is ordered until None comes, or the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    begin()
    static = None
    while os.getppid() == parent:
        try:
            order = orders.get(timeout=1.0)
        except Empty:
            continue
        if order is None:
            break
        static = static or read(order[0], Static)
        write_png(order[2], draw(read(order[1]), look, static))
    end()
