"""A fast jet against a pinned sheet: nothing gets through, the clips feel the jet's momentum, and its path is bent."""

from typing import Any

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.meeting.load import Load
from sim.studies.probe import row

MET = 0.08
"""[s] Water poured longer ago has met the sheet: 12 cm at 4 m/s, and as much again."""


def measure(world: Any) -> dict[str, float]:
    """Figures of the run. Momenta along x, which nothing but the clips changes.

    error   impulse of the clips less what water and sheet have lost, over what the jet has brought
    kept    of the x momentum that it brought, what water poured more than MET ago has at the end: 1 straight on, 0
            along the sheet, -1 thrown back
    strain  the largest of any frame
    caught  share of particle-steps in which the last step acted
    leaks   crossings
    """
    load, particle_steps, strain, met = Load(world), 0, 0.0, 0
    books = _Books(world)
    start = load.momentum()[0]
    load.begin()
    while world.frame_index < world.frame_count:
        if world.step():
            strain = max(strain, world.build.parts["cloth"].max_strain())
        if world.clock.time < world.config.run.duration - MET:
            met = int(world.state["scene.population.next_id"][0])
        books.look()
        particle_steps += int(world.state.count[None])
    counts = world.build.parts["contact"].counts()
    brought = world.ledger_row()["emitted"] * books.speed
    have = load.momentum()[0] + books.gone - start
    old = row(world, "id") < met
    mass, v = row(world, "mass")[old], row(world, "v")[old, 0]
    return {
        "error": (load.carried()[0] * load.time - (have - brought)) / abs(brought),
        "kept": (mass * v).sum() / (mass.sum() * books.speed),
        "strain": strain,
        "caught": counts["caught"] / particle_steps,
        "leaks": counts["leaks"],
    }


class _Books:
    """speed: the jet's along x [m/s]; gone: x momentum that left with the water that went out of space [kg m/s]."""

    def __init__(self, world: Any):
        self.world, (spout,) = world, world.config.emitter.values()
        way = np.array(spout.direction)
        self.speed = spout.speed * way[0] / np.linalg.norm(way)
        self.gone, self.last = 0.0, {}

    def look(self) -> None:
        """Who was there a step ago and is no more took along what it then had."""
        names = row(self.world, "id").astype(int).tolist()
        now = dict(zip(names, (row(self.world, "mass") * row(self.world, "v")[:, 0]).tolist()))
        self.gone += sum(p for name, p in self.last.items() if name not in now)
        self.last = now


CASE = Case(
    name="sheet_jet",
    scene="sheet_jet",
    reference="nothing passes; force = momentum brought per second",
    bounds={"error": 0.01, "kept": 0.35, "leaks": 0.0, "strain": 0.105},
    measure=measure,
    full=(Point(("run.duration=0.3 s",)),),
    quick=(Point(("fluid.spacing=4 mm", "cloth.spacing=1 cm", "run.duration=0.15 s", "emitter.nozzle.rate=600 ml/s")),),
)
