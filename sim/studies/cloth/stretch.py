"""A sheet pulled, then hung, in grips that slide sideways: the fabric's stiffness and Poisson's ratio come back."""

import numpy as np

from sim.studies.case import Case, Point
from sim.studies.cloth.rest import Traction, settled

STRAIN = 1e-3
"""[1] Springs at an angle to the pull are linear to about this."""
GRAVITY = 9.81
"""[m/s^2] Along the sheet, when it hangs."""
METHODS = {
    "implicit_euler": (),
    "symplectic_euler": (),
    "xpbd": ("cloth.xpbd.substep_max=0.02 ms",),
}


def measure(world) -> dict[str, float]:
    """Relative errors: hanging of rho_A g L/(2 Y); stiffness of Y [N/m], poisson of 1/3 if pulled; error: the largest.

    Elongation is between the means of two edges: with a load all along an edge that is exact at any width (Betti 1872).
    """
    solver, pull, sheet = world.build.parts["cloth"], world.build.parts["traction"], world.scene.sheet
    fabric, length = world.config.cloth.fabric, world.config.cloth.size[0]
    weight = fabric.area_density * GRAVITY * length
    pull.force[0], pull.force[1] = weight, 0.0
    solver.gravity = (GRAVITY, 0.0, 0.0)
    x, cost = settled(world)
    hung, _ = strains(x, sheet.spacing)
    load = STRAIN * fabric.stretch
    pull.force[0] = pull.force[1] = load
    solver.gravity = (0.0, 0.0, 0.0)
    x, _ = settled(world)
    along, across = strains(x, sheet.spacing)
    errors = {
        "hanging": hung / (weight / (2.0 * fabric.stretch)) - 1.0,
        "stiffness": load / along / fabric.stretch - 1.0,
        "poisson": -3.0 * across / along - 1.0,
    }
    return {"error": max(map(abs, errors.values())), **errors, **cost}


def strains(x: np.ndarray, spacing: float) -> tuple[float, float]:
    """Mean strains of a sheet (ni, nj, 3) along x and y, edge against edge; the ends of an edge count half."""
    ni, nj = x.shape[:2]
    weight = [np.where(np.isin(np.arange(n), (0, n - 1)), 0.5, 1.0) for n in (ni, nj)]
    along = np.average(x[-1, :, 0] - x[0, :, 0], weights=weight[1]) / (spacing * (ni - 1)) - 1.0
    across = np.average(x[:, -1, 1] - x[:, 0, 1], weights=weight[0]) / (spacing * (nj - 1)) - 1.0
    return float(along), float(across)


def of(method: str, *more: str) -> Point:
    """A point of a method."""
    return Point((f"cloth.method={method}", *more), "f64")


CASE = Case(
    name="stretch",
    scene="pull",
    reference="Y and nu = 1/3, Lloyd et al. 2007",
    bounds={"hanging": 0.01, "stiffness": 0.02, "poisson": 0.02},
    measure=measure,
    full=tuple(of(method, *more) for method, more in METHODS.items()),
    quick=(of("xpbd", "cloth.spacing=20 mm", *METHODS["xpbd"]),),
    prepare=Traction,
)
