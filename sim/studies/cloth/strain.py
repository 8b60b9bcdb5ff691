"""No thread is stretched past its limit: the largest strain of every frame, of every shipped scene that has a limit."""

from sim.studies.case import Case, Point

SCENES = (
    "basin", "buoyancy", "curtain", "drape", "fabrics", "flag", "handclap", "pile", "pool", "sandwich", "seep",
    "sheet_jet", "spill", "tablecloth", "twist",
)  # fmt: skip


def measure(world) -> dict[str, float]:
    """strain: the largest at t = 0 and at every frame; frame: the first that has it."""
    solver = world.build.parts["cloth"]
    strains = [solver.max_strain()]
    for _ in range(world.frame_count):
        world.advance()
        strains.append(solver.max_strain())
    return {"strain": max(strains), "frame": strains.index(max(strains))}


CASES = tuple(
    Case(
        name=f"strain_{scene}",
        scene=scene,
        reference="the strain limit, and a twentieth of it for sweeps that end",
        bounds={"strain": 0.105},
        measure=measure,
        full=(Point(),),
        quick=(),
    )
    for scene in SCENES
)
