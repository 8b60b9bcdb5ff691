"""Pictures to a film: H.264 in MP4."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import imageio_ffmpeg
import numpy as np

from sim.errors import ConfigError, RunError

QUALITY = 16  # constant rate factor: 0 lossless, 23 the codec's default; smooth gradients show no bands


def write_film(path: Path, pictures: Iterable[np.ndarray], size: tuple[int, int], fps: float) -> int:
    """Write uint8 (h, w, 3) pictures of exactly `size` (w, h) and return how many; the file is whole or absent.

    Both sides must be even, as 4:2:0 colour asks: ConfigError. RunError if the disk or the encoder refuses.
    """
    width, height = size
    if width % 2 or height % 2:
        raise ConfigError(f"render.size = [{width}, {height}]: a film needs even numbers")
    path = Path(path)
    part = path.with_name(path.name + ".part.mp4")
    count = 0
    encoder = imageio_ffmpeg.write_frames(
        str(part),
        size,
        fps=fps,
        codec="libx264",
        pix_fmt_out="yuv420p",
        quality=None,
        macro_block_size=1,
        output_params=["-crf", str(QUALITY), "-preset", "medium", "-movflags", "+faststart"],
        ffmpeg_log_level="error",
    )
    try:
        encoder.send(None)
        for picture in pictures:
            if picture.shape != (height, width, 3):
                raise RunError(f"{path}: picture {count} is {picture.shape}, not {(height, width, 3)}")
            encoder.send(np.ascontiguousarray(picture))
            count += 1
        encoder.close()
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror or error}") from error
    finally:
        encoder.close()
        part.unlink(missing_ok=True)
    return count
