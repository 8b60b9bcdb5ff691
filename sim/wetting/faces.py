"""Water through the faces between patches: each face moves whole mass units once, so mass and momentum balance."""

import taichi as ti


@ti.data_oriented
class Faces:
    """Of the patch grid: patch (i, j) is row i * columns + j, and its next neighbours lie along i [0] and j [1].

    A kernel first asks what goes through every face (`ask`), then lets every patch take its share (`take`).
    """

    def __init__(self, water):
        self.water = water
        self.along = ti.field(ti.i64, shape=(water.rows, water.columns, 2))

    @ti.func
    def ask(self, mover: ti.template(), i, j, dt):
        """mover.through(p, q, dt): mass units from patch p to q in this step."""
        p = i * self.water.columns + j
        self.along[i, j, 0] = 0
        self.along[i, j, 1] = 0
        if i + 1 < self.water.rows:
            self.along[i, j, 0] = mover.through(p, p + self.water.columns, dt)
        if j + 1 < self.water.columns:
            self.along[i, j, 1] = mover.through(p, p + 1, dt)

    @ti.func
    def take(self, store: ti.template(), i, j):
        """Into store[p] [units], and momentum with it."""
        p = i * self.water.columns + j
        if i > 0:
            self._receive(store, p, p - self.water.columns, self.along[i - 1, j, 0])
        if j > 0:
            self._receive(store, p, p - 1, self.along[i, j - 1, 1])
        if i + 1 < self.water.rows:
            self._receive(store, p, p + self.water.columns, -self.along[i, j, 0])
        if j + 1 < self.water.columns:
            self._receive(store, p, p + 1, -self.along[i, j, 1])

    @ti.func
    def _receive(self, store: ti.template(), p, other, units):
        """What comes brings the other's velocity, what goes takes p's."""
        store[p] += units
        v = self.water.velocity[other]
        if units < 0:
            v = self.water.velocity[p]
        self.water.carry(p, units, v)
