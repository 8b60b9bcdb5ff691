"""From linear radiance to a picture: film tone curve, sRGB, PNG."""

import os
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import taichi as ti

from render.opaque import IMAGE
from sim.errors import RunError

PIXELS = ti.types.ndarray(dtype=ti.u8, ndim=3)
EXPOSURE = 0.33
STEPS, RANGE = 8192, 2048.0  # the table ends at an exposure of (STEPS/RANGE)^2 = 16, which is white


def film_curve(x: np.ndarray) -> np.ndarray:
    """Linear exposure -> sRGB in 0..1: a film's toe and shoulder (Narkowicz 2015, fit of ACES), then IEC 61966-2-1."""
    y = np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)
    return np.where(y < 0.0031308, 12.92 * y, 1.055 * np.maximum(y, 1e-9) ** (1.0 / 2.4) - 0.055)


CURVE = np.round(255.0 * film_curve((np.arange(STEPS) / RANGE) ** 2)).astype(np.uint8)


@ti.kernel
def develop(image: IMAGE, curve: ti.types.ndarray(dtype=ti.u8, ndim=1), pixels: PIXELS):
    """Linear RGB (h, w) -> uint8 (h, w, 3), by a table over the square root of the exposure."""
    for y, x in ti.ndrange(image.shape[0], image.shape[1]):
        for c in ti.static(range(3)):
            step = RANGE * ti.sqrt(ti.max(EXPOSURE * image[y, x][c], 0.0)) + 0.5
            pixels[y, x, c] = curve[ti.cast(ti.min(step, STEPS - 1.0), ti.i32)]


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write uint8 (h, w, 3) atomically: the file is whole or absent. RunError if the disk refuses."""
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        iio.imwrite(part, pixels, extension=".png", compress_level=3)
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror}") from error
