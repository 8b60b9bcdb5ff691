"""The sheet's nodes as rows of lanes, so that eight springs are corrected at once.

A row of nodes is padded to a multiple of LANES; x, y and z lie in fields of their own. Eight neighbours are read,
computed and written as one vector: the compiler makes SIMD of it (0.8 ns a spring in f32, 1.5 in f64, against 4.5
one by one). Springs along a row need it turned, eight rows at a time: a band beside the board, of columns LANES long.
Reals are f64 where the device has it: a substep's fall, g h^2 = 1e-7 m, is 7 units in the last place of an f32 at
0.2 m, and velocities read off positions would be 6 % wrong.
"""

import numpy as np
import taichi as ti

from sim import runtime

LANES = 8
REACH = (1 << 26) - 1
"""A mask over every place on a board. It changes no place, but shows the compiler that place + 7 cannot overflow;
without that it will not read eight neighbours as one vector, and a sweep takes 145 us instead of 27."""


def private_real():
    """The type of what a cloth solver keeps within a step: f64, or the default where there is none (Metal)."""
    return ti.f32 if (runtime.running() or {}).get("arch") == "metal" else ti.f64


@ti.data_oriented
class Board:
    """x, start, v: three real fields each (place, place at the substep's start, velocity); w: inverse mass [1/kg].

    Node (i, j) stands at i*pitch + j, and with its band turned at half + j*LANES + i % LANES (x and w only).
    """

    def __init__(self, shape: tuple[int, int]):
        self.real = private_real()
        self.numpy_real = np.float32 if self.real == ti.f32 else np.float64
        self.ni, self.nj = shape
        self.pitch = pitch_of(self.nj)
        self.half = self.ni * self.pitch + LANES
        self.bands = -(-self.ni // LANES)
        self.whole = self.half + self.nj * LANES + LANES
        self.x = [ti.field(self.real, self.whole) for _ in range(3)]
        self.w = ti.field(self.real, self.whole)
        self.start = [ti.field(self.real, self.half) for _ in range(3)]
        self.v = [ti.field(self.real, self.half) for _ in range(3)]
        self.lanes = ti.types.vector(LANES, self.real)

    def laid_out(self, values: np.ndarray) -> np.ndarray:
        """Values a node -> as a field of this board holds them, 0 elsewhere."""
        rows = np.zeros((self.ni, self.pitch), self.numpy_real)
        rows[:, : self.nj] = values.reshape(self.ni, self.nj)
        return np.concatenate([rows.ravel(), np.zeros(LANES, rows.dtype)])

    @ti.func
    def place(self, node):
        """Where node i*nj + j stands on the board."""
        return place_of(node, self.nj, self.pitch)

    @ti.func
    def get(self, field: ti.template(), at):
        """LANES neighbours."""
        first = at & REACH
        return self.lanes([field[first + k] for k in range(LANES)])

    @ti.func
    def put(self, field: ti.template(), at, values):
        """The reverse of `get`."""
        first = at & REACH
        for k in ti.static(range(LANES)):
            field[first + k] = values[k]

    @ti.func
    def get_three(self, three: ti.template(), at):
        """x, y and z of LANES neighbours."""
        return self.get(three[0], at), self.get(three[1], at), self.get(three[2], at)

    @ti.func
    def put_three(self, three: ti.template(), at, x, y, z):
        """The reverse of `get_three`."""
        self.put(three[0], at, x)
        self.put(three[1], at, y)
        self.put(three[2], at, z)

    @ti.func
    def vector(self, three: ti.template(), at):
        """One node's vector out of three fields."""
        return ti.Vector([three[0][at], three[1][at], three[2][at]])

    @ti.func
    def set_vector(self, three: ti.template(), at, value):
        """The reverse of `vector`."""
        for d in ti.static(range(3)):
            three[d][at] = value[d]

    @ti.func
    def clear(self):
        """No place, no velocity anywhere: what a failed run left beside the sheet, NaN, would spread from there."""
        for at in range(self.whole):
            for d in ti.static(range(3)):
                self.x[d][at] = 0.0
        for at in range(self.half):
            for d in ti.static(range(3)):
                self.v[d][at] = 0.0

    @ti.func
    def turn(self, band, back):
        """Copy a band of LANES rows to where it stands turned, or from there; tile by tile, as caches like it."""
        first = band * LANES
        for tile in range(self.pitch // LANES):
            for k in range(ti.min(LANES, self.ni - first)):
                for j in range(tile * LANES, ti.min((tile + 1) * LANES, self.nj)):
                    near, far = (first + k) * self.pitch + j, self.half + j * LANES + k
                    for d in ti.static(range(3)):
                        if back:
                            self.x[d][near] = self.x[d][far]
                        else:
                            self.x[d][far] = self.x[d][near]
                    self.w[far] = self.w[near]


def pitch_of(nj: int) -> int:
    """Places from one row of nj nodes to the next."""
    return LANES * (nj // LANES + 1)


@ti.pyfunc
def place_of(node, nj, pitch):
    """Where node i*nj + j stands on a board; nodes in a NumPy array, too.

    What asks in each substep looks it up: dividing takes a third of the time that a contact takes.
    """
    return node // nj * pitch + node % nj
