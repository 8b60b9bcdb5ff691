"""The bench's scene in pySPlisHSPlasH, timed. Run by an interpreter that has it, which need not have seep:

    python splishsplash.py ORDER.json       writes what ORDER.json names: figures (JSON) and positions (npz)

The order is sim.studies.bench.orders: SI, z up. SPlisHSPlasH has y up, so axes turn on the way in and out. Whatever the
order does not say is as in its own scene DamBreakModel.
"""

import glob
import importlib.util
import json
import os
import resource
import sys
import time
from pathlib import Path

METHODS = {"wcsph": 0, "pbf": 2, "dfsph": 4}
BOX = """v -0.5 -0.5 -0.5\nv 0.5 -0.5 -0.5\nv 0.5 0.5 -0.5\nv -0.5 0.5 -0.5
v -0.5 -0.5 0.5\nv 0.5 -0.5 0.5\nv 0.5 0.5 0.5\nv -0.5 0.5 0.5
f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8
"""
SOLVES = {"divergence": "iterationsV", "density": "iterations"}
"""Of a step, in their order, with the counters of their iterations."""
DIVERGENCE = 0.1
"""[% of rho0 in a step] as shipped; it counts compression alone, and stops before the update that it has computed."""
TURN = [0, 2, 1]
"""Their y is our z. (The turn mirrors; so is nothing in this scene.)"""


def find_libraries(folder: Path) -> None:
    """Start again with the wheel's own libOpenGL in the place of libGL.

    Its libGLU asks for libGL.so.1, finds the system's, and two copies of libGLdispatch crash in the import.
    """
    spec = importlib.util.find_spec("pysplishsplash")
    if spec is None:
        sys.exit("pySPlisHSPlasH is not installed")
    bundled = glob.glob(str(Path(spec.origin).parent / "pysplishsplash.libs" / "libOpenGL-*"))
    shim = folder / "libraries"
    searched = os.environ.get("LD_LIBRARY_PATH", "")
    if not bundled or searched.startswith(str(shim)):
        return
    shim.mkdir(parents=True, exist_ok=True)
    link = shim / "libGL.so.1"
    link.unlink(missing_ok=True)
    link.symlink_to(bundled[0])
    os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | {"LD_LIBRARY_PATH": f"{shim}:{searched}"})


def scene(order: dict, folder: Path) -> Path:
    """The scene file, and the unit box that its walls are scaled from."""
    d, (lx, ly, lz) = order["spacing"], order["tank"]
    low, high = order["block"]
    mesh = folder / "box.obj"
    mesh.write_text(BOX)
    fixed = order["step"] > 0.0
    configuration = {
        "particleRadius": 0.5 * d, "density0": order["rest_density"], "simulationMethod": METHODS[order["method"]],
        "gravitation": [0, -order["gravity"], 0], "timeStepSize": order["step"] if fixed else order["dt_max"],
        "cflMethod": 0 if fixed else 1, "cflFactor": order["cfl"] / 0.4, "cflMaxTimeStepSize": order["dt_max"],
        "boundaryHandlingMethod": 2,
    }  # fmt: skip
    tank = {
        "geometryFile": str(mesh), "translation": [0, 0.5 * lz, 0], "scale": [lx, lz, ly], "isDynamic": False,
        "isWall": True, "mapInvert": True, "mapThickness": 0.0, "mapResolution": [40, 30, 15],
    }  # fmt: skip
    # A block of theirs leaves the first and the last lattice plane out: it is given half a spacing larger all round.
    block = {
        "denseMode": 0, "translation": [0, 0, 0], "scale": [1, 1, 1],
        "start": [low[k] - 0.5 * d for k in TURN], "end": [high[k] + 0.5 * d for k in TURN],
    }  # fmt: skip
    liquid = {"id": "Fluid", "surfaceTensionMethod": 0, "viscosityMethod": 1 if order["nu"] else 0}
    liquid["viscosity"] = order["nu"]
    path = folder / f"{order['method']}_{order['count']}.json"
    whole = {"Configuration": configuration, "Materials": [liquid], "RigidBodies": [tank], "FluidBlocks": [block]}
    path.write_text(json.dumps(whole, indent=1))
    return path


def set_solver(solver, order: dict) -> None:
    """Tolerances and stiffness. Set by hand: from the scene file 2.19 reads none of a solver, and says nothing."""
    real = {
        "maxError": 100 * order["density_error"], "maxErrorV": DIVERGENCE,
        "stiffness": order["stiffness"], "exponent": 7.0,
    }  # fmt: skip
    for k in range(solver.numParameters()):
        name = solver.getName(k)
        if name in real:
            solver.setValueFloat(k, real[name])
            if abs(solver.getValueFloat(k) / real[name] - 1.0) > 1e-5:
                sys.exit(f"{name} cannot be set to {real[name]}")
        elif name in ("maxIterations", "maxIterationsV"):
            solver.setValueUInt(k, 100)


class Watch:
    """Called after every step: what it took, and now and then what it made. Its own time is not counted."""

    def __init__(self, simulation, clock, order: dict):
        self.model, self.clock, self.order, self.simulation = simulation.getFluidModel(0), clock, order, simulation
        self.solver = simulation.getTimeStep()
        names = [self.solver.getName(k) for k in range(self.solver.numParameters())]
        self.counters = [names.index(n) if n in names else None for n in SOLVES.values()]
        self.steps, self.samples, self.positions, self.frames = [], [], {}, 0
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def __call__(self) -> None:
        wall, cpu = time.perf_counter() - self.wall, time.process_time() - self.cpu
        iterations = [0 if k is None else self.solver.getValueUInt(k) for k in self.counters]
        self.steps.append([self.clock.getTime(), self.clock.getTimeStepSize(), wall, cpu, *iterations])
        if self.clock.getTime() >= self.frames * self.order["sample"] - 1e-9:
            self._look()
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def _look(self) -> None:
        import numpy as np

        count = self.model.numActiveParticles()
        density = np.array(self.model.getFieldBuffer("density"), float)[:count] / self.order["rest_density"]
        some = range(0, count, 50)
        near = sum(self.simulation.numberOfNeighbors(0, 0, i) for i in some) / len(some)
        compression = np.maximum(density - 1.0, 0.0)
        self.samples.append([self.clock.getTime(), float(compression.mean()), float(density.max()), near])
        if self.frames % self.order["keep"] == 0:
            x = np.array(self.model.getFieldBuffer("position"))[:count][:, TURN]
            self.positions[f"{self.frames * self.order['sample']:.3f}"] = x
        self.frames = int(self.clock.getTime() / self.order["sample"] + 1e-9) + 1


def main() -> None:
    """Run the order named on the command line."""
    order = json.loads(Path(sys.argv[1]).read_text())
    folder = Path(sys.argv[1]).resolve().parent
    find_libraries(folder)
    import numpy as np
    import pysplishsplash as sph

    base = sph.Exec.SimulatorBase()
    where = str(scene(order, folder))
    base.init(sceneFile=where, useGui=False, initialPause=False, outputDir=str(folder / "out"), stopAt=order["seconds"])
    base.initSimulation()
    set_solver(sph.Simulation.getCurrent().getTimeStep(), order)
    watch = Watch(sph.Simulation.getCurrent(), sph.TimeManager.getCurrent(), order)
    base.setTimeStepCB(watch)
    base.setValueFloat(base.STOP_AT, order["seconds"])
    base.runSimulation()
    sph.Utilities.Timing.printTimeSums()
    np.savez(order["positions"], **watch.positions)
    figures = {
        "count": watch.model.numActiveParticles(), "mass": watch.model.getMass(0), "steps": watch.steps,
        "solves": [name for name, k in zip(SOLVES, watch.counters) if k is not None],
        "samples": watch.samples, "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }  # fmt: skip
    Path(order["figures"]).write_text(json.dumps(figures))


if __name__ == "__main__":
    main()
