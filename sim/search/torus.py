"""Space that closes on itself along some axes: where a place counts, and which image of a neighbour is nearest."""

from typing import Any

import taichi as ti


@ti.data_oriented
class Torus:
    """Axes of space.periodic: x and x + L are one place, L = high - low. Without any, it compiles to nothing.

    nearest(r)   x_i - x_j -> the shortest of its images, for |r| <= 3 L/2; of x_j - x_i exactly the opposite
    wrap(x)      into [low, high]
    cells...     the three cells round one on a ring, rising; see sim.search.grid
    Limit: L >= 2 H, or two images of one neighbour would be near (sim.fit refuses it).
    """

    def __init__(self, space: Any):
        self.axes = tuple("xyz".index(a) for a in space.periodic)
        self.parts = 2 if 0 in self.axes else 1
        self.low = [float(a) for a in space.low]
        self.size = [float(b) - float(a) for a, b in zip(space.low, space.high)]

    @ti.func
    def nearest(self, r):
        """The shortest image of a difference."""
        for a in ti.static(self.axes):
            r[a] = self.nearest_along(a, r[a])
        return r

    @ti.func
    def nearest_along(self, a: ti.template(), r):
        """The same along one axis; of several at once, if r is a vector of them."""
        if ti.static(a in self.axes):
            length = ti.static(self.size[a])
            r -= ti.select(r > 0.5 * length, length, 0.0) - ti.select(r < -0.5 * length, length, 0.0)
        return r

    @ti.func
    def wrap(self, x):
        """The image of x in space."""
        for a in ti.static(self.axes):
            x[a] -= ti.static(self.size[a]) * ti.floor((x[a] - ti.static(self.low[a])) / ti.static(self.size[a]))
        return x

    @ti.func
    def window(self, a: ti.template(), cell, count):
        """(first, end) of the numbers that `cell` below turns into the neighbours of a cell along axis a."""
        first, end = ti.max(cell - 1, 0), ti.min(cell + 2, count)
        if ti.static(a in self.axes):
            first, end = 0, ti.min(count, 3)
        return first, end

    @ti.func
    def cell(self, a: ti.template(), number, cell, count):
        """The cell of a number in `window`; on a ring the three round `cell`, rising."""
        found = number
        if ti.static(a in self.axes):
            if count > 3:
                found = cell - 1 + number
                if cell == 0:
                    found = ti.select(number == 2, count - 1, number)
                elif cell == count - 1:
                    found = ti.select(number == 0, 0, cell - 2 + number)
        return found

    @ti.func
    def stretch(self, part: ti.template(), left, right, count):
        """(first, last) cell along x of [left, right], a row of `count`; on a ring in two parts, rising, first > last
        where one is empty."""
        first, last = ti.max(left, 0), ti.min(right, count - 1)
        if ti.static(0 in self.axes):
            right = ti.min(right, left + count - 1)
            turn = ti.select(left < 0, count, 0)
            first, last = left + turn, right + turn
            passes = last >= count
            if ti.static(part == 0):
                first, last = ti.select(passes, 0, first), ti.select(passes, last - count, last)
            else:
                last = ti.select(passes, count - 1, first - 1)
        return first, last
