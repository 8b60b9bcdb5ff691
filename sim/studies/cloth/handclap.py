"""The report's small cloth, which clapped for ever, comes to rest with `robust`: half a minute without drift."""

from sim.studies.case import Case, Point
from sim.studies.cloth.tablecloth import measure

CASE = Case(
    name="handclap",
    scene="handclap",
    reference="at rest: 1e-6 of the fall's energy, over 30 s",
    bounds={"error": 1e-6, "drift": 0.5e-3, "depth": 0.0, "crossings": 0.0, "strain": 0.105},
    measure=measure,
    full=(Point(("cloth.self_contact=robust", "run.duration=10", "run.fps=10")),),  # drag stills it in eight
    quick=(),
)
