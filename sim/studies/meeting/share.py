"""What meeting costs: search and contact of 20,000 particles with 20,000 patches, as a share of the step.

Patches are two particles wide, as in every scene.
"""

import time
from collections import defaultdict

from sim.studies.case import Case, Point

WARM, STEPS = 60, 20
"""Steps before the clock starts, and while it runs."""


def measure(world) -> dict[str, float]:
    """Processor time, all threads together, which a busy machine hardly changes.

    error   search and contact over the step: both figures that follow
    search  of the stages that look for the sheet (boxes, sides, cuts, the last step)
    layer   of the water inside the cloth's substeps: of the cloth's stage, less the same sheet without water on it
    NAME_ms a step, of each stage
    """
    spent: dict[str, float] = defaultdict(float)
    dry = 0.0
    for step in range(WARM + STEPS):
        dt = world.clock.next_step(world.stages)
        for stage in world.stages:
            wall, began = time.perf_counter(), time.process_time()
            stage.run(dt)
            spent[stage.name] += (time.process_time() - began) * (step >= WARM)
            world.seconds[stage.name] += time.perf_counter() - wall
        world.clock.advance(dt)
        touching = int(world.build.parts["contact"].layer.count[None])
        dry += _without_water(world, dt) if step >= WARM else 0.0
    whole = sum(spent.values())
    search = sum(seconds for name, seconds in spent.items() if name.startswith("contact.")) / whole
    layer = (next(seconds for name, seconds in spent.items() if name.startswith("cloth.")) - dry) / whole
    figures = {"error": search + layer, "search": search, "layer": layer}
    figures |= {f"{name}_ms": 1e3 * seconds / STEPS for name, seconds in spent.items()}
    return figures | {"touching": touching, "patches": len(world.scene.sheet.patches)}


def _without_water(world, dt: float) -> float:
    """Processor time of the sheet's step if nothing lay on it [s]; the sheet is put back."""
    cloth, kept = world.build.parts["cloth"], {n: world.state[n].to_numpy() for n in ("cloth.x", "cloth.v")}
    world.build.parts["contact"].layer.count[None] = 0
    began = time.process_time()
    cloth.advance(dt, cloth.params.damping, cloth.params.drag)
    seconds = time.process_time() - began
    for name, values in kept.items():
        world.state[name].from_numpy(values)
    return seconds


CASE = Case(
    name="share",
    scene="pool",
    reference="search and contact, of the whole step",
    bounds={"error": 0.15},
    measure=measure,
    full=(
        Point(
            ("fluid.spacing=2.5 mm", "fluid.block.lump={low=[-0.0625,-0.0625,0.221],high=[0.0625,0.0625,0.241]}",
             "emitter.spout.start=1 s", "space.low=[-0.4,-0.4,-0.01]", "space.high=[0.4,0.4,0.3]",
             "cloth.size=[0.705,0.705]", "cloth.slack=0", "cloth.settle=0 s", "cloth.pins.corners.where=edges"),
        ),
    ),
    quick=(),
)  # fmt: skip
