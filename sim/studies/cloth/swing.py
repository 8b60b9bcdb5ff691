"""A strip held by one edge, let go level: the way of its free edge against a fine run's."""

import numpy as np

from sim.errors import DivergedError
from sim.studies.case import Case

TIMES = np.arange(1, 31) * 0.01
"""[s] From the fall to the way back up."""
REFERENCE: tuple = ()


def measure(world) -> dict[str, float]:
    """error: rms distance of the free edge's middle from the reference, over the strip's length."""
    solver, sheet, length = world.build.parts["cloth"], world.scene.sheet, world.config.cloth.size[0]
    way = []
    solver.simulated, solver.substeps = 0.0, 0
    for _ in TIMES:
        frame = world.advance()
        x = frame.cloth_x.reshape(*sheet.shape, 3)[-1, sheet.shape[1] // 2].astype(float)
        way.append((x[0], x[2] - world.config.cloth.centre[2]))
    gap = np.linalg.norm(np.array(way) - REFERENCE, axis=1) / length
    return {
        "error": float(np.sqrt((gap**2).mean())),
        "latest": float(gap[-1]),
        "dt": solver.simulated / solver.substeps,
        "particles": len(sheet.x),
    }
