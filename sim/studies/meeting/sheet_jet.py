"""A fast jet against a pinned sheet: nothing gets through, and no thread stretches past its limit."""

from typing import Any

from sim.studies.case import Case, Point


def measure(world: Any) -> dict[str, float]:
    """Figures of the run: leaks; caught, the share of particle-steps in which the last step acted; strain, the largest
    of any frame."""
    particle_steps, strain = 0, 0.0
    while world.frame_index < world.frame_count:
        if world.step():
            strain = max(strain, world.build.parts["cloth"].max_strain())
        particle_steps += int(world.state.count[None])
    counts = world.build.parts["contact"].counts()
    return {"caught": counts["caught"] / particle_steps, "leaks": counts["leaks"], "strain": strain}


CASE = Case(
    name="sheet_jet",
    scene="sheet_jet",
    reference="nothing passes",
    bounds={"leaks": 0.0, "strain": 0.105},
    measure=measure,
    full=(Point(),),
    quick=(Point(("fluid.spacing=4 mm", "cloth.spacing=1 cm", "run.duration=0.1 s", "emitter.nozzle.rate=600 ml/s")),),
)
