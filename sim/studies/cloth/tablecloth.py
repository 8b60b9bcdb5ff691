"""A cloth over a round table comes to rest, and stays there: half a minute without drift, nothing pierced."""

import numpy as np
import taichi as ti

from sim.bodies import Bodies
from sim.studies.case import Case, Point
from sim.studies.crossings import crossings

AFTER = 30
"""[s] Looked at after the scene's end, at every frame; for crossings once a second."""


def measure(world) -> dict[str, float]:
    """error: kinetic energy over its peak, the most of AFTER. drift: the farthest that a node is then from where it
    was at the scene's end [m]. depth: of a node in a solid [m]. crossings: at the worst look. strain: the largest."""
    triangles, fps = np.asarray(world.scene.sheet.triangles), world.config.run.fps
    solver, depth = world.build.parts["cloth"], Depth(world)
    energies, strain = [], 0.0
    for _ in range(world.frame_count):
        settled = world.advance().cloth_x
        energies.append(solver.kinetic_energy())
        strain = max(strain, solver.max_strain())
    later, drift, deepest, found = [], 0.0, depth.most(), crossings(settled, triangles)
    for _ in range(AFTER):
        for _ in range(fps):
            x = world.advance().cloth_x
            later.append(solver.kinetic_energy())
            drift = max(drift, float(np.linalg.norm(x - settled, axis=1).max()))
        deepest, found = max(deepest, depth.most()), max(found, crossings(x, triangles))
    figures = {"drift": drift, "depth": deepest, "crossings": found, "strain": max(strain, solver.max_strain())}
    return {"error": max(later) / max(energies)} | figures


@ti.data_oriented
class Depth:
    """How far nodes of the sheet are inside the scene's solids."""

    def __init__(self, world):
        self.x, self.bodies = world.state["cloth.x"], Bodies.of(world.build)

    def most(self) -> float:
        """[m], 0 where none is."""
        return self._most()

    @ti.kernel
    def _most(self) -> float:
        deepest = 0.0
        for n in self.x:
            for s in range(self.bodies.count):
                ti.atomic_max(deepest, -self.bodies.distance(s, self.x[n])[3])
        return deepest


CASE = Case(
    name="tablecloth",
    scene="tablecloth",
    reference="at rest: 1e-6 of the fall's energy, over 30 s",
    bounds={"error": 1e-6, "drift": 0.5e-3, "depth": 0.0, "crossings": 0.0, "strain": 0.105},
    measure=measure,
    full=(Point(("run.fps=10",)),),
    quick=(),
)
