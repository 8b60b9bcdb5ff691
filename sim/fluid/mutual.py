"""The pressure solve of much water: each pair once, for what it gives one particle it takes from the other."""

import taichi as ti

from sim.crew import BLOCK, Lists, blocks, rows
from sim.errors import CapacityError
from sim.fluid.projection import DEMAND, PUSH, RELAX, START, TURN, Projection
from sim.search.sieve import ENTRIES

LANES = 4
"""Pairs that a sweep does without asking whether there are more: rows are filled up with pairs of no force."""
GRAIN = 32
"""Rows: where chunks may begin."""
EVEN, ODD, ROWS = range(3)
"""Parts of a phase with a sweep: of the even chunks, of the odd, and what follows for each row. START has two."""


@ti.data_oriented
class Mutual(Projection):
    """A sweep adds what a pair gives to a sum of i, and the same or its opposite to the sum of j: half the list to read
    and half the places to fetch. At a million particles a sweep takes 30 ns of each, all told, instead of 36; but rows
    are gone through once more for their sums, so few particles, whose lists lie in the cache, gain nothing.

        pairs of row i   k = LANES start[i] ... LANES start[i + 1] - 1,  j = near[k] >= i,  pull[k] = m_i m_j (dW/dr)/r

    Threads must not meet in a sum. So rows are cut into chunks such that whatever a chunk's rows are paired with lies
    in it or in the one that follows; first all even chunks are swept, then the odd. Chunks follow from the list alone,
    and so do the bits. Rows are sorted along the water's longest axis, so there are many: 48 of a million particles in
    a cube. Not for periodic space, where rows close a ring.
    """

    def __init__(self, owner):
        super().__init__(owner)
        capacity = owner.state.sizes["fluid"]
        self.middle, self.mass, self.inverse_mass = self.pairs.list.middle, owner.mass, self.pairs.inverse_mass
        self.farthest = ti.field(ti.i32, capacity // GRAIN + 1)
        self.bound, self.eights = (ti.field(ti.i32, capacity // BLOCK + 3) for _ in range(2))
        self.chunks, self.part = ti.field(ti.i32, ()), ti.field(ti.i32, ())

    def lists(self) -> Lists:
        """neighbour and slope of Pairs; start, near and pull."""
        if self._lists is None or self._lists.slope is not self.pairs.slope:
            capacity, pairs = self.o.state.sizes["fluid"], self.pairs.slope.shape[0] // 2
            start, near, pull = self._room(capacity + 1, pairs + LANES * capacity)
            given = {"neighbour": self.pairs.neighbour, "slope": self.pairs.slope}
            self._lists = Lists(**given, start=start, near=near, pull=pull)
        return self._lists

    def _room(self, rows: int, length: int) -> tuple[ti.Field, ...]:
        """In one tree of fields: having read a row's start the compiler knows where the others lie."""
        tree, fields = ti.FieldsBuilder(), (ti.field(ti.i32), ti.field(ti.i32), ti.field(float))
        for field, size in zip(fields, (rows, length, length)):
            tree.dense(ti.i, size).place(field)
        try:
            tree.finalize()
        except RuntimeError as error:
            raise CapacityError(f"fluid: no memory for {length} pairs; use a larger spacing") from error
        return fields

    @ti.func
    def begin(self):
        """Before the first phase."""
        self.phase[None], self.part[None] = START, 0
        self._enter(0)

    @ti.func
    def tasks(self):
        """Chunks of the part that is on, or blocks of rows."""
        found = blocks(self.o.state.count[None])
        if self._sweeps():
            found = (self.chunks[None] + 1 - self.part[None]) // 2
        return found

    @ti.func
    def _sweeps(self):
        phase = self.phase[None]
        swept = phase == DEMAND or phase == PUSH or phase == RELAX or phase == TURN
        return swept and self.part[None] != ROWS

    @ti.func
    def work(self, task, dt, lists: ti.template()):
        """A chunk's or a block's share of the phase."""
        phase, part = self.phase[None], self.part[None]
        if self._sweeps():
            chunk = 2 * task + part
            for i in range(self.bound[chunk], self.bound[chunk + 1]):
                if phase == PUSH:
                    self._sweep_pushes(i, lists)
                elif phase == TURN:
                    if ti.static(self.spins):
                        self._sweep_turns(i, dt, lists)
                else:
                    self._sweep_rates(i, lists)
        elif phase == START and part == 0:
            self._count(task, lists)
        else:
            if phase == START:
                self._pair(task, lists)
            self._over_rows(task, dt, lists)

    @ti.func
    def decide(self):
        """What comes next; whether anything does."""
        more = True
        if self._sweeps():
            self.part[None] = ODD if self.part[None] == EVEN and self.chunks[None] > 1 else ROWS
        elif self.phase[None] == START and self.part[None] == 0:
            self._cut()
            self.part[None] = 1
        else:
            self.part[None] = 0
            more = self._next()
        return more

    @ti.func
    def _count(self, block, lists: ti.template()):
        """How much room the pairs of a block of rows need, and how far they reach."""
        first, end = rows(block, self.o.state.count[None])
        eights, last = 0, first
        for i in range(first, end):
            middle, stop = self.middle[i], self.pairs.stop[i]
            if i % GRAIN == 0:
                last = i
            if middle < stop:
                last = ti.max(last, lists.neighbour[stop - 1])
            self.farthest[i // GRAIN] = last
            eights += (stop - middle + LANES - 1) // LANES
        self.eights[block + 1] = eights

    @ti.func
    def _cut(self):
        """Room for each block; and rows into chunks of like length: a multiple of four of them, if so many can be."""
        self.eights[0] = 0
        for block in range(blocks(self.o.state.count[None])):
            self.eights[block + 1] += self.eights[block]
        self._cut_by(BLOCK)
        fours = self.chunks[None] // 4 * 4
        if fours > 0:
            self._cut_by((self.o.state.count[None] + fours - 1) // fours)

    @ti.func
    def _cut_by(self, least):
        """Into chunks of at least that many rows."""
        count, farthest, seen, chunks = self.o.state.count[None], -1, 0, 1
        end = ti.min((least + GRAIN - 1) // GRAIN * GRAIN, count)
        self.bound[0], self.bound[1] = 0, end
        while end < count:
            while seen * GRAIN < end:
                farthest = ti.max(farthest, self.farthest[seen])
                seen += 1
            end = ti.max(end + least, farthest + 1)
            end = ti.min((end + GRAIN - 1) // GRAIN * GRAIN, count)
            chunks += 1
            self.bound[chunks] = end
        self.chunks[None] = chunks

    @ti.func
    def _pair(self, block, lists: ti.template()):
        """The pairs of a block of rows."""
        first, end = rows(block, self.o.state.count[None])
        eight = self.eights[block]
        for i in range(first, end):
            lists.start[i] = eight
            middle, mass, at = self.middle[i], self.mass[i], (eight * LANES) & ENTRIES
            pairs = self.pairs.stop[i] - middle
            for n in range(pairs):
                lists.near[at + n], lists.pull[at + n] = lists.neighbour[middle + n], mass * lists.slope[middle + n]
            whole = (pairs + LANES - 1) // LANES
            for n in range(pairs, whole * LANES):
                lists.near[at + n], lists.pull[at + n] = i, 0.0
            eight += whole
            self.sums[i] = ti.Vector([0.0, 0.0, 0.0, 0.0])
        lists.start[end] = eight  # as the next block writes, too

    @ti.func
    def _sweep_rates(self, i, lists: ti.template()):
        own, place, total = self.o.u[i], self.pairs.place[i], self.sums[i]
        for eight in range(lists.start[i], lists.start[i + 1]):
            for n in ti.static(range(LANES)):
                at = ((eight * LANES) & ENTRIES) + n
                j = lists.near[at]
                rate = self._rate_of(own, place, j, lists.pull[at])
                total += rate
                self.sums[j] = self.sums[j] + rate
        self.sums[i] = total

    @ti.func
    def _sweep_pushes(self, i, lists: ti.template()):
        own, place, total = self.o.guess[i], self.pairs.place[i], self.sums[i]
        for eight in range(lists.start[i], lists.start[i + 1]):
            for n in ti.static(range(LANES)):
                at = ((eight * LANES) & ENTRIES) + n
                j = lists.near[at]
                push = self._push_of(own, place, j, lists.pull[at])
                total += push
                self.sums[j] = self.sums[j] - push
        self.sums[i] = total

    @ti.func
    def _sweep_turns(self, i, dt, lists: ti.template()):
        own, u, place, total = self.pushed[i], self.o.u[i], self.pairs.place[i], self.sums[i]
        for eight in range(lists.start[i], lists.start[i + 1]):
            for n in ti.static(range(LANES)):
                at = ((eight * LANES) & ENTRIES) + n
                j = lists.near[at]
                push = self._turn_of(own, u, place, dt, j, lists.pull[at])
                total += push
                self.sums[j] = self.sums[j] - push
        self.sums[i] = total

    @ti.func
    def _take(self, i):
        """A row's sum, from forces to what they do to it; the next begins with nothing."""
        total = self.inverse_mass[i] * self.sums[i]
        self.sums[i] = ti.Vector([0.0, 0.0, 0.0, 0.0])
        return total

    @ti.func
    def _rates(self, i, lists: ti.template()):
        return self._take(i)

    @ti.func
    def _pushes(self, i, a, lists: ti.template()):
        return a + self._take(i)

    @ti.func
    def _turns(self, i, dt, lists: ti.template()):
        return self._take(i)
