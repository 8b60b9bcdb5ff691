"""The cloth bench's sheet in pyPBD, timed. Run by an interpreter that has it, which need not have seep:

    python positionbased.py ORDER.json      writes what ORDER.json names: figures (JSON) and positions (npz)

The order is sim.studies.bench_cloth.order: SI, z up. pyPBD has y up, and lays its sheet upright as ours hangs.
"""

import json
import resource
import sys
import time
from pathlib import Path

DISTANCE_XPBD, ISOMETRIC_XPBD = 4, 3
"""As addClothConstraints and addBendingConstraints number them."""


def main() -> None:
    """Run the order named on the command line."""
    order = json.loads(Path(sys.argv[1]).read_text())
    import numpy as np
    import pypbd as pbd

    simulation = pbd.Simulation.getCurrent()
    simulation.initDefault()
    model, stepper = simulation.getModel(), simulation.getTimeStep()
    n, side = order["nodes"], order["size"]
    sheet = model.addRegularTriangleModel(n, n, [0, 0, 0], np.eye(3), [side, side])
    particles = model.getParticles()
    for k, mass in enumerate(order["mass"]):
        particles.setMass(k, mass)
    for k in order["held"]:
        particles.setMass(k, 0.0)
    k = order["stiffness"]
    model.addClothConstraints(sheet, DISTANCE_XPBD, k, k, k, k, 0.3, 0.3, False, False)
    springs = len(model.getConstraints())
    model.addBendingConstraints(sheet, ISOMETRIC_XPBD, order["bending"])
    stepper.setValueUInt(stepper.NUM_SUB_STEPS, order["substeps"])
    stepper.setValueUInt(stepper.MAX_ITERATIONS, 1)
    pbd.TimeManager.getCurrent().setTimeStepSize(order["step"])
    steps, kept = [], []
    count = round(order["seconds"] / order["step"])
    for turn in range(count + 1):
        wall, cpu = time.perf_counter(), time.process_time()
        stepper.step(model)
        if turn:  # the first one colours the constraints
            steps.append([time.perf_counter() - wall, time.process_time() - cpu])
        if turn and turn % order["sample"] == 0:
            kept.append([particles.getPosition(k) for k in range(n * n)])
    np.savez(order["positions"], x=np.array(kept))
    figures = {
        "steps": steps, "constraints": len(model.getConstraints()), "springs": springs,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }  # fmt: skip
    Path(order["figures"]).write_text(json.dumps(figures))


if __name__ == "__main__":
    main()
