"""Which of eight rows in a row are near a place, and their numbers written one behind the other."""

import numpy as np
import taichi as ti

from sim import runtime
from sim.search.pair_list import BLOCK
from sim.search.torus import Torus

LANES = 8
LEFT_OUT = 1e20
"""[m] So far apart are particles without a place (NaN) taken to be, from each other and from all else."""
ROWS, ENTRIES = (1 << 26) - 1, (1 << 30) - 1
"""Masks over every row and every entry of a list. They change none, but show the compiler that eight that follow cannot
overflow; without that it does not take them as one vector."""


@ti.data_oriented
class Sieve:
    """Eight differences, squares and comparisons are one SIMD instruction each, where x, y and z lie apart; and a table
    tells for each of the 256 outcomes in which order to write rows, so that no branch depends on chance: 8 instructions
    a candidate instead of 17 (Lemire & Boytsov 2015 decode so).

    Two things are spelt as they are for the compiler's sake. Whether a square is too small is read off the sign of a
    difference, and the eight answers go through memory (`flags`, of a block of rows, which one thread works on), from
    where `zero` hides that they come straight back: it would else pick them out of a mask register, one by one.
    """

    def __init__(self, capacity: int, radius: float, torus: Torus):
        self.torus, self.radius_sq = torus, radius * radius
        whole = ti.i64 if runtime.running()["precision"] == "f64" else ti.i32
        self.sign = 63 if whole == ti.i64 else 31
        self.whole, self.reals = whole, ti.types.vector(LANES, float)
        self.wholes, self.rows = ti.types.vector(LANES, whole), ti.types.vector(LANES, ti.i32)
        self.place = [ti.field(float, capacity + LANES) for _ in range(3)]
        self.bit, self.order = ti.field(whole, LANES), ti.field(ti.i32, LANES << LANES)
        self.flags, self.zero = ti.field(whole, (capacity // BLOCK + 1) * LANES), ti.field(ti.i32, ())
        outcomes = np.arange(1 << LANES)[:, None] >> np.arange(LANES) & 1
        self.bit.from_numpy(1 << np.arange(LANES).astype(np.int64 if self.sign == 63 else np.int32))
        self.order.from_numpy(np.argsort(1 - outcomes, axis=1, kind="stable").astype(np.int32).ravel())

    @ti.func
    def take(self, x: ti.template(), i):
        """Row i of the field x, before rows are asked about."""
        for a in ti.static(range(3)):
            place = x[i][a]
            self.place[a][i] = LEFT_OUT * (1 + i) if ti.math.isnan(place) else place

    @ti.func
    def at(self, i):
        """Where row i is taken to be."""
        return ti.Vector([self.place[0][i], self.place[1][i], self.place[2][i]])

    @ti.func
    def near(self, x, i, first, end):
        """Bit n: row first + n, unless it is i or lies behind `end`, is nearer to x than the radius."""
        square, begin = self.reals(0.0), first & ROWS
        for a in ti.static(range(3)):
            others = self.reals([self.place[a][begin + n] for n in range(LANES)])
            r = self.torus.nearest_along(a, x[a] - others)
            square += r * r
        less = ti.bit_cast(square - ti.cast(self.radius_sq, float), self.whole) >> self.sign
        flags = less & self.wholes([self.bit[n] for n in range(LANES)])
        at = (i // BLOCK * LANES) & ROWS
        for n in ti.static(range(LANES)):
            self.flags[at + n] = flags[n]
        bits, at = ti.cast(0, self.whole), (at + self.zero[None]) & ROWS
        for n in ti.static(range(LANES)):
            bits += self.flags[at + n]
        own, asked = i - first, (1 << ti.min(end - first, LANES)) - 1
        if 0 <= own and own < LANES:
            asked &= ~(1 << own)
        return ti.cast(bits, ti.i32) & asked

    @ti.func
    def write(self, neighbour: ti.template(), cursor, first, bits):
        """The rows of `bits` from `cursor` on; what follows them, up to LANES entries, may be anything."""
        at, row = cursor & ENTRIES, (bits & 255) * LANES
        found = first + self.rows([self.order[row + n] for n in range(LANES)])
        for n in ti.static(range(LANES)):
            neighbour[at + n] = found[n]
