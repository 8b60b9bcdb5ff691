"""The state: Taichi fields made from one table of rows. Permute, save and load walk the table.

A row's group is the first word of its name: "fluid" rows have one entry a particle, up to a capacity, of which the
first `fluid.count` are alive; "cloth" rows one a node, "patch" rows one a quad of the sheet. Only rows that a stage
of the scene names are allocated, so a section that is absent costs nothing.
"""

from typing import Iterable, NamedTuple

import numpy as np
import taichi as ti

from sim.errors import CapacityError


class Row(NamedTuple):
    """name, dtype ("f" real, "v" 3-vector of reals, "i" int32, "m" int64 mass units), unit, meaning.

    saved: belongs to the state, so it is kept in checkpoints and follows particles when they are sorted.
    """

    name: str
    dtype: str
    unit: str
    meaning: str
    saved: bool = True


ROWS = {
    row.name: row
    for row in (
        Row("fluid.id", "i", "1", "number given at birth, never used again"),
        Row("fluid.x", "v", "m", "position"),
        Row("fluid.v", "v", "m/s", "velocity"),
        Row("fluid.mass", "f", "kg", "mass, derived from mass_units"),
        Row("fluid.mass_units", "m", "1e-15 kg", "mass as the ledger counts it"),
        Row("fluid.density", "f", "kg/m^3", "density of the last sweep", saved=False),
        Row("fluid.acceleration", "v", "m/s^2", "of gravity and terms, without pressure", saved=False),
        Row("fluid.pressure_acceleration", "v", "m/s^2", "-grad p/rho of the last solve"),
        Row("fluid.expected_pull", "v", "m/s^2", "the same, as the cloth's substeps expect it"),
        Row("fluid.triangle", "i", "1", "nearest triangle of the cloth within reach, else -1"),
        Row("fluid.side", "i", "1", "+1 in front of it, -1 behind, 0 beyond a hem or out of reach", saved=False),
        Row("cloth.x", "v", "m", "position"),
        Row("cloth.v", "v", "m/s", "velocity"),
        Row("cloth.inv_mass", "f", "1/kg", "0 for a pinned node; wet mass included"),
        Row("cloth.mass", "f", "kg", "lumped mass, dry plus held water"),
        Row("cloth.push_front", "f", "N s", "normal impulse of water on the front during this step", saved=False),
        Row("cloth.push_back", "f", "N s", "the same on the back", saved=False),
        Row("cloth.pressure_front", "f", "Pa", "contact pressure of water in front, mean over 30 ms"),
        Row("cloth.pressure_back", "f", "Pa", "the same behind"),
        Row("patch.pores", "m", "1e-15 kg", "water in the pores"),
        Row("patch.film", "m", "1e-15 kg", "water hanging below, not yet a drop"),
    )
}
"""Every public row. Private rows are declared by their method as `scratch`, named group.method.row."""


@ti.data_oriented
class State:
    """Fields by row name: `state["fluid.x"]`. `state.count` is the 0-D field of living particles (or None).

    moving: names of the rows that follow particles when they are sorted.
    sizes: entries a group, e.g. {"fluid": capacity, "cloth": node_count, "patch": patch_count}.
    Raises CapacityError if the memory does not hold them.
    """

    def __init__(self, rows: Iterable[Row], sizes: dict[str, int]):
        self.rows = {row.name: row for row in rows}
        self.sizes = dict(sizes)
        self.fields = {}
        try:
            for row in self.rows.values():
                self.fields[row.name] = _allocate(row.dtype, self._size(row))
        except RuntimeError as error:
            raise CapacityError(f"state: no memory for {self.sizes}; use a larger spacing") from error
        self.count = ti.field(ti.i32, shape=()) if self.sizes.get("fluid") else None
        self.moving = tuple(n for n, r in self.rows.items() if n.startswith("fluid.") and r.saved)
        self._spare = None

    def __getitem__(self, name: str):
        return self.fields[name]

    def __contains__(self, name: str) -> bool:
        return name in self.fields

    def _size(self, row: Row) -> int:
        return max(self.sizes[row.name.split(".")[0]], 1)

    def permute_fluid(self, order) -> None:
        """new[i] = old[order[i]] for every saved fluid row; order: i32 field, its first `count` entries."""
        if self._spare is None:
            self._spare = [_allocate(self.rows[n].dtype, self._size(self.rows[n])) for n in self.moving]
        self._permute(order)

    @ti.kernel
    def _permute(self, order: ti.template()):
        for i in range(self.count[None]):
            for k in ti.static(range(len(self.moving))):
                self._spare[k][i] = self.fields[self.moving[k]][order[i]]
        for i in range(self.count[None]):
            for k in ti.static(range(len(self.moving))):
                self.fields[self.moving[k]][i] = self._spare[k][i]

    def save(self) -> dict[str, np.ndarray]:
        """Every saved row as NumPy; of fluid rows the living entries only."""
        kept = {n: self.fields[n].to_numpy() for n, r in self.rows.items() if r.saved}
        if self.count is not None:
            living = int(self.count[None])
            kept = {n: a[:living] if n.startswith("fluid.") else a for n, a in kept.items()}
        return kept

    def load(self, kept: dict[str, np.ndarray]) -> None:
        """The reverse of `save`, bit for bit; entries beyond the living ones become 0."""
        for name, row in self.rows.items():
            if row.saved:
                field = self.fields[name]
                whole = np.zeros(field.shape + ((3,) if row.dtype == "v" else ()), kept[name].dtype)
                whole[: len(kept[name])] = kept[name]
                field.from_numpy(whole)
            else:
                self.fields[name].fill(0)
        if self.count is not None:
            self.count[None] = len(kept["fluid.id"])


def _allocate(dtype: str, size: int):
    if dtype == "v":
        return ti.Vector.field(3, float, shape=size)
    return ti.field({"f": float, "i": ti.i32, "m": ti.i64}[dtype], shape=size)
