"""A dropped cloth crumples into a pile that never pierces itself, keeps its strain limit, and comes to rest."""

from __future__ import annotations

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.crossings import crossings


def measure(world) -> dict[str, float]:
    """error: crossings at the worst frame. strain: the largest. rest: kinetic energy over its peak at the end. depth:
    how far the lowest node is under the ground [m]. stops: zones that had to be stopped."""
    triangles = np.asarray(world.scene.sheet.triangles)
    solver, worst, strain, peak, low = world.build.parts["cloth"], 0, 0.0, 0.0, 0.0
    for _ in range(world.frame_count):
        x = world.advance().cloth_x
        worst, strain = max(worst, crossings(x, triangles)), max(strain, solver.max_strain())
        energy = solver.kinetic_energy()
        peak, low = max(peak, energy), min(low, float(x[:, 2].min()))
    stops = world.build.parts["self_contact"].counts()["carried"]
    return {"error": worst, "strain": strain, "rest": energy / peak, "depth": low, "stops": stops}


CASE = Case(
    name="pile",
    scene="pile",
    reference="brute force: every edge against every triangle, at every frame",
    bounds={"error": 0.0, "strain": 0.105, "depth": 0.0},
    measure=measure,
    full=(Point(("run.duration=3",)),),
    quick=(Point(("cloth.spacing=9.9 mm", "run.duration=1")),),
)
