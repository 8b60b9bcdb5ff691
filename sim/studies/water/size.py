"""What a particle costs: the same sweep over ten thousand and over a million of them."""

from sim.studies.case import Case, Point

STEPS = 5


def measure(world) -> dict[str, float]:
    """Nanoseconds a particle from a lattice at rest: of one sweep, of a step, and of each of its stages.

    sweep_ns is the time of the pressure's solves over their iterations and two more, for what stands around them; of
    STEPS steps the quickest, so that a busy machine disturbs it less. The others are means.
    """
    particles, sweeps = int(world.state.count[None]), []
    for _ in range(STEPS):
        seconds, iterations = world.seconds["pressure"], world.iterations
        world.step()
        sweeps.append((world.seconds["pressure"] - seconds) / (world.iterations - iterations + 2))
    each = 1e9 / (STEPS * particles)
    stages = {f"{name}_ns": seconds * each for name, seconds in world.seconds.items()}
    return {"sweep_ns": min(sweeps) * 1e9 / particles, "step_ns": sum(world.seconds.values()) * each, **stages}


def _point(across: int) -> Point:
    return Point((f"fluid.spacing={100 / across!r} mm", "fluid.dfsph.iterations_max=50"))


CASE = Case(
    name="size",
    scene="still_tank",
    reference="cost a particle and sweep, whatever the size",
    bounds={"spread(sweep_ns)": 0.25, "peak_memory": 2e9},
    measure=measure,
    full=tuple(_point(across) for across in (22, 46, 100)),
    quick=(),
)
