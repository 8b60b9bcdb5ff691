"""What a particle costs: the same sweep over ten thousand and over a million of them."""

from sim.studies.case import Case, Point

STEPS = 5


def measure(world) -> dict[str, float]:
    """Nanoseconds a particle over STEPS steps from a lattice at rest: a step in all, its stages, and one sweep.

    sweep_ns is the time of both pressure solves over their iterations and one more each, for what stands around them.
    """
    for _ in range(STEPS):
        world.step()
    each = 1e9 / (STEPS * int(world.state.count[None]))
    solves = world.seconds["divergence"] + world.seconds["pressure"]
    stages = {f"{name}_ns": seconds * each for name, seconds in world.seconds.items()}
    return {
        "sweep_ns": solves * each * STEPS / (world.iterations + 2 * STEPS),
        "step_ns": sum(world.seconds.values()) * each,
        **stages,
    }


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
