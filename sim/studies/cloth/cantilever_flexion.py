"""The same strip with the report's bending springs: shown, and held to nothing."""

from dataclasses import replace

from sim.studies.cloth import cantilever

CASE = replace(
    cantilever.CASE,
    name="cantilever_flexion",
    bounds={},
    full=tuple(cantilever.of(gamma, "xpbd", 20, "flexion") for gamma in (1.0, 10.0, 100.0)),
    quick=tuple(cantilever.of(gamma, "xpbd", 10, "flexion") for gamma in (10.0,)),
)
