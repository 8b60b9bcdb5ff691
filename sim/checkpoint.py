"""Whole state to disk and back, bit for bit; a file is whole or absent, even after a power cut."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from sim.errors import RunError

SCHEMA = 1
_STATE = "state."


def write_whole(path: Path, fill: Callable[[BinaryIO], Any]) -> None:
    """`fill` writes PATH.part; it is forced to disk, then takes the name PATH. RunError if the disk refuses."""
    part = path.with_name(path.name + ".part")
    try:
        with open(part, "wb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror}") from error


def write_text(path: Path, text: str) -> None:
    """A text file, whole or absent."""
    write_whole(path, lambda file: file.write(text.encode()))


def write(path: Path, frame: int, state: dict[str, Any]) -> None:
    """Keep `state` (arrays and plain numbers by name) as it stands at the end of frame number `frame`."""
    arrays = {_STATE + name: np.asarray(value) for name, value in state.items()}
    write_whole(path, lambda file: np.savez(file, schema=np.int32(SCHEMA), frame=np.int64(frame), **arrays))


def read(path: Path) -> tuple[int, dict[str, np.ndarray]]:
    """(frame number, state): what `write` kept; numbers come back as 0-d arrays. RunError if it cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as file:
            kept = {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise RunError(f"{path}: not a readable checkpoint; start the run again without --resume") from error
    if int(kept.get("schema", -1)) != SCHEMA:
        raise RunError(f"{path}: schema {kept.get('schema', 'missing')}; this program reads {SCHEMA}")
    return int(kept["frame"]), {n.removeprefix(_STATE): a for n, a in kept.items() if n.startswith(_STATE)}
