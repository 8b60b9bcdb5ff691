"""The same strip with the report's bending springs, which must fail: they have no stiffness against a gentle bend."""

from dataclasses import replace

from sim.studies.cloth import cantilever


def measure(world) -> dict[str, float]:
    """error, as of the cantilever; pretence: what that is held to, over it. Above 1 flexion would do as well."""
    found = cantilever.measure(world)
    return found | {"pretence": cantilever.CASE.bounds["error"] / found["error"]}


CASE = replace(
    cantilever.CASE,
    name="cantilever_flexion",
    bounds={"pretence": 1.0},
    measure=measure,
    full=tuple(cantilever.of(gamma, "xpbd", 20, "flexion") for gamma in (1.0, 10.0, 100.0)),
    quick=tuple(cantilever.of(gamma, "xpbd", 10, "flexion") for gamma in (10.0,)),
)
