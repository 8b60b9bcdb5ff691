"""What a particle costs: the same sweep over ten thousand and over a million of them."""

import time
from collections import defaultdict

import numpy as np

from sim.studies.case import Case, Point

STEPS, SECONDS = 5, 2.0
"""At least, and of processor time: five steps of a small tank are over before the processor has its pace."""


def measure(world) -> dict[str, float]:
    """Nanoseconds of processor time a particle, all threads together, which a busy machine hardly changes.

    sweep_ns   of one sweep over the neighbours: the pressure's solves over their sweeps, two an iteration (PUSH,
               RELAX), one before the first (DEMAND) and, of much water, one that lists the pairs; the median over steps
               from a lattice at rest
    pair_ns    the same over the neighbours that a particle has: fewer at a surface, of which a small tank has more
    iterations of both solves, a step
    step_ns    of a step in all, and NAME_ns of each of its stages: means
    """
    particles, sweeps, met, spent = int(world.state.count[None]), [], [], defaultdict(float)
    before = world.build.parts["pressure"].projection.sweeps_before
    while len(sweeps) < STEPS or sum(spent.values()) < SECONDS:
        dt = world.clock.next_step(world.stages)
        for stage in world.stages:
            wall, began = time.perf_counter(), time.process_time()
            stage.run(dt)
            took = time.process_time() - began
            spent[stage.name] += took
            world.seconds[stage.name] += time.perf_counter() - wall
            if stage.name == "pressure":
                iterations = sum(world.build.parts["pressure"].iterations.values())
                sweeps.append(took / (2 * iterations + before))
                met.append(iterations)
        world.iterations += iterations
        world.clock.advance(dt)
    each = 1e9 / (len(sweeps) * particles)
    stages = {f"{name}_ns": seconds * each for name, seconds in spent.items()}
    sweep = np.median(sweeps) * 1e9 / particles
    pairs = world.build.parts["pairs"].list
    neighbours = (pairs.stop.to_numpy() - pairs.start.to_numpy())[:particles].mean()
    figures = {"sweep_ns": sweep, "pair_ns": sweep / neighbours, "neighbours": neighbours}
    return figures | {"iterations": np.mean(met), "step_ns": sum(stages.values()), **stages}


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
