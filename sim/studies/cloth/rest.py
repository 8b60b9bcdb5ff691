"""What the cases of cloth share: a sheet brought to rest, timed; loads along its edges."""

import time
from collections.abc import Callable

import numpy as np
import taichi as ti

from sim.errors import DivergedError

SECONDS = 4.0
"""[s] Simulated, at most, until a sheet is at rest."""
STILL = 1e-6
"""[m/s] rms. A sheet that elongates by 15 um rings at 900 1/s: this leaves 1e-4 of that."""
BURST = 100.0
"""[1] Strain that no sheet at rest comes near, not even one that a solver leaves a thousand times too soft."""

ROUNDS, ENOUGH = 5, 0.5
"""How often a run is timed, and after how many seconds no more [s]: what is over in milliseconds is timed by chance."""


def least(run: Callable[[], float]) -> float:
    """What `run` says that it took, at best."""
    took: list[float] = []
    while len(took) < ROUNDS and sum(took) < ENOUGH:
        took.append(run())
    return min(took)


def settled(world, seconds: float = SECONDS) -> tuple[np.ndarray, dict[str, float]]:
    """Places (ni, nj, 3) of the sheet brought to rest from where it begins [m]; what that cost, as a chart has it.

    DivergedError where it does not come to rest but flies apart.
    """
    solver, sheet = world.build.parts["cloth"], world.scene.sheet
    solver.settle(1e-3)  # warm: nothing is compiled after this

    def run() -> float:
        world.state["cloth.x"].from_numpy(sheet.x)
        solver.simulated, solver.substeps = 0.0, 0
        began = time.perf_counter()
        solver.settle(seconds, STILL, evenly=True)
        return time.perf_counter() - began

    took = least(run)
    x = world.state["cloth.x"].to_numpy().astype(np.float64).reshape(*sheet.shape, 3)
    if not (np.isfinite(x).all() and solver.max_strain() < BURST):
        causes = "; ".join(suspect.words for suspect in solver.suspects())
        raise DivergedError(
            f"exploding before it is at rest, t = {solver.simulated:.4g} s: {causes or 'no known cause'}"
        )
    solves, iterations = solver.iterations() if hasattr(solver, "iterations") else (1, 0)
    return x, {
        "iterations": iterations / solves,
        "seconds_per_simulated_second": took / solver.simulated,
        "dt": solver.simulated / solver.substeps,
        "steps": solver.substeps,
        "simulated": solver.simulated,
    }


def rows_held(sheet) -> int:
    """Rows i = 0, 1, ... that are held."""
    return int((sheet.inv_mass.reshape(sheet.shape).max(1) == 0.0).sum())


@ti.data_oriented
class Traction:
    """A guest that pulls the edges i = 0 and i = last along x: force[0] and force[1] [N/m], outward.

    Pulled so, an edge may slide sideways, as in grips that hold along the pull alone, and the stress is uniform.
    """

    reads, writes = (), ()

    def __init__(self, world):
        self.cloth, (self.ni, self.nj) = world.build.parts["cloth"], world.scene.sheet.shape
        self.spacing = world.scene.sheet.spacing
        self.force = ti.field(ti.f64, 2)
        world.build.parts["guests"].append(self)
        world.build.parts["traction"] = self

    def begin(self, dt):
        """Nothing to prepare."""

    def end(self, dt):
        """Nothing to hand back."""

    @ti.func
    def predict(self, h):
        for j in range(self.nj):
            share = self.spacing * (0.5 if j == 0 or j == self.nj - 1 else 1.0)
            self._pull(j, -self.force[0] * share, h)
            self._pull((self.ni - 1) * self.nj + j, self.force[1] * share, h)

    @ti.func
    def _pull(self, node, newtons, h):
        at = self.cloth.board.place(node)
        self.cloth.shift(at, ti.Vector([h * h * newtons * self.cloth.weight(at), 0.0, 0.0]))

    @ti.func
    def project(self, h):
        pass

    @ti.func
    def finish(self, h):
        pass
