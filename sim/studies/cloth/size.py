"""What a node of cloth costs: the same substep over ten thousand and over a million of them."""

import time

import numpy as np

from sim.studies.case import Case, Point

SUBSTEPS = 20
"""To a step, as in one of run.dt_max."""
ROUNDS = 5


def measure(world) -> dict[str, float]:
    """node_ns: processor time of a substep over the nodes [ns], the median of ROUNDS, on however many threads."""
    solver, nodes = world.build.parts["cloth"], len(world.scene.sheet.x)
    h, spent = solver.substep_max(), []
    for _ in range(ROUNDS):
        wall, began = time.perf_counter(), time.process_time()
        solver.advance(SUBSTEPS * h, 0.0, 0.0)
        spent.append(time.process_time() - began)
        world.seconds["cloth"] += time.perf_counter() - wall
    return {
        "node_ns": 1e9 * float(np.median(spent)) / (SUBSTEPS * nodes),
        "seconds_per_simulated_second": sum(world.seconds.values()) / (ROUNDS * SUBSTEPS * h),
        "dt": h,
        "steps": ROUNDS * SUBSTEPS,
    }


def _point(across: int) -> Point:
    side = f"{across - 1} cm"
    return Point((f'cloth.size=["{side}", "{side}"]', "cloth.spacing=1 cm"))


CASE = Case(
    name="size",
    scene="pull",
    reference="cost a node and substep, whatever the size",
    bounds={"spread(node_ns)": 0.25, "peak_memory": 2e9},
    measure=measure,
    full=tuple(_point(across) for across in (100, 316, 1000)),
    quick=(),
)
