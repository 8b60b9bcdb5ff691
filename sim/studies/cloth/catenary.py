"""A strip hung from both ends, against the catenary."""

import math

import numpy as np

from sim.studies.case import Case
from sim.studies.cloth.rest import settled
from sim.studies.cloth.stretch import METHODS, of


def sag(length: float, distance: float) -> float:
    """Of an inextensible chain [m]: sinh(q)/q = length/distance, sag = distance (cosh q - 1)/(2 q).  Bernoulli 1691"""
    low, high = 1e-6, 20.0
    for _ in range(80):
        q = 0.5 * (low + high)
        low, high = (q, high) if math.sinh(q) / q < length / distance else (low, q)
    return 0.5 * distance * (math.cosh(q) - 1.0) / q


def measure(world) -> dict[str, float]:
    """error: of the sag in the middle of the strip."""
    x, cost = settled(world)
    ni, nj = world.scene.sheet.shape
    middle = x[:, nj // 2]
    found = middle[0, 2] - middle[(ni - 1) // 2, 2]
    length = world.config.cloth.size[0]
    exact = sag(length, float(np.linalg.norm(middle[-1] - middle[0])))
    return {"error": abs(found / exact - 1.0), "sag": found, **cost}


CASE = Case(
    name="catenary",
    scene="catenary",
    reference="catenary, Bernoulli 1691",
    bounds={"error": 0.01},
    measure=measure,
    full=tuple(of(method, *more) for method, more in METHODS.items()),
    quick=(of("xpbd", *METHODS["xpbd"]),),
)
