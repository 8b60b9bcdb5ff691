"""Where every gram is. Masses are summed as integers, so `mass_error` is exactly 0 or a bug."""

from dataclasses import dataclass

import numpy as np

from sim.constants import MASS_UNIT

COLUMNS = (
    "frame", "time", "emitted", "free", "held", "film", "drained", "dried", "mass_error", "leaks", "passed",
    "density_error", "max_speed", "kinetic_energy", "max_strain", "dt",
)  # fmt: skip
"""Of ledger.csv: kg, s, m/s, J; mass_error relative; a column that is not modelled is empty."""


@dataclass
class Masses:
    """Totals in whole MASS_UNITs; None where the scene has no such holder."""

    emitted: int | None = None
    free: int | None = None
    held: int | None = None
    film: int | None = None
    drained: int | None = None
    dried: int | None = None

    def error(self) -> float | None:
        """(emitted - everything else) / emitted; exactly 0 if the ledger closes."""
        if self.emitted is None:
            return None
        rest = sum(m for m in (self.free, self.held, self.film, self.drained, self.dried) if m is not None)
        return (self.emitted - rest) / max(self.emitted, 1)

    def columns(self) -> dict[str, float | None]:
        """In kg, and the error."""
        names = ("emitted", "free", "held", "film", "drained", "dried")
        masses = {n: getattr(self, n) for n in names}
        row = {n: None if m is None else m * MASS_UNIT for n, m in masses.items()}
        return {**row, "mass_error": self.error()}


def kinetic_energy(mass: np.ndarray, v: np.ndarray) -> float:
    """sum m v^2 / 2 [J], in f64."""
    return float(0.5 * (mass.astype(np.float64) * (v.astype(np.float64) ** 2).sum(1)).sum())


def top_speed(v: np.ndarray) -> float:
    """Largest |v| [m/s], 0 for none."""
    return float(np.sqrt((v.astype(np.float64) ** 2).sum(1).max())) if len(v) else 0.0
