"""The pressure solve of much water: each pair once, for what it gives one particle it takes from the other."""

import taichi as ti

from sim.crew import BLOCK, Lists, blocks, rows
from sim.errors import CapacityError
from sim.fluid.projection import DEMAND, PUSH, RELAX, START, TURN, Projection

LANES = 4
"""Pairs that a sweep does without asking whether there are more: rows are filled up with pairs of no force."""
GRAIN = 32
"""Rows: where chunks may begin."""
NONE, PUSHES, RATES, TURNS = range(4)
"""Sweeps."""
FAR = 4.0
"""[1] A residual so many times its tolerance is not below it one iteration later."""


@ti.data_oriented
class Mutual(Projection):
    """A sweep adds what a pair gives to a sum of i, and the same or its opposite to the sum of j: half the list to read
    and half the places to fetch. At a hundred thousand particles a sweep takes 18 ns of each instead of 26.

        pairs of row i   [k, n],  k = start[i] ... start[i + 1] - 1,  n < LANES
                         j = near[k, n] >= i,  pull[k, n] = m_i m_j (dW/dr)/r

    Threads must not meet in a sum. So rows are cut into chunks such that whatever a chunk's rows are paired with lies
    in it or in the one that follows; first all even chunks are swept, then the odd. Chunks follow from the list alone,
    and so do the bits. Rows are sorted along the water's longest axis, so there are many: 48 of a million particles in
    a cube. Not for periodic space, where rows close a ring.

    Once a chunk is swept, its own sums and those of the next are whole if the others have been: what follows for these
    rows follows at once, and then the next sweep over the same chunk, while its pairs are in the cache:

        even chunks   PUSH
        odd           PUSH, their rows and the next; RELAX
        even          RELAX, their rows and the next; PUSH of the next iteration, if that is sure to come
    """

    sweeps_before = 2
    """DEMAND, and the pass that lists the pairs."""

    def __init__(self, owner):
        super().__init__(owner)
        capacity = owner.state.sizes["fluid"]
        self.middle, self.mass, self.inverse_mass = self.pairs.list.middle, owner.mass, self.pairs.inverse_mass
        self.farthest = ti.field(ti.i32, capacity // GRAIN + 1)
        self.bound, self.fours = (ti.field(ti.i32, capacity // BLOCK + 3) for _ in range(2))
        self.chunks, self.odd, self.led = (ti.field(ti.i32, ()) for _ in range(3))

    def lists(self) -> Lists:
        """neighbour and slope of Pairs; start, near and pull."""
        if self._lists is None or self._lists.slope is not self.pairs.slope:
            capacity, pairs = self.o.state.sizes["fluid"], self.pairs.slope.shape[0] // 2
            start, near, pull = self._room(capacity + 1, pairs // LANES + capacity)
            given = {"neighbour": self.pairs.neighbour, "slope": self.pairs.slope}
            self._lists = Lists(**given, start=start, near=near, pull=pull)
        return self._lists

    def _room(self, rows: int, length: int) -> tuple[ti.Field, ...]:
        """In one tree of fields: having read a row's start the compiler knows where the others lie.

        Lane by lane: the processor fetches eight streams that run slowly farther ahead than two that run fast. At a
        million particles, whose pairs come from memory, a sweep takes a fifth less.
        """
        tree, fields = ti.FieldsBuilder(), (ti.field(ti.i32), ti.field(ti.i32), ti.field(float))
        tree.dense(ti.i, rows).place(fields[0])
        for field in fields[1:]:
            tree.dense(ti.j, LANES).dense(ti.i, length).place(field)
        try:
            tree.finalize()
        except RuntimeError as error:
            raise CapacityError(f"fluid: no memory for {LANES * length} pairs; use a larger spacing") from error
        return fields

    @ti.func
    def begin(self):
        """Before the first phase."""
        self.phase[None], self.odd[None] = START, 0
        self._enter(0)

    @ti.func
    def _sweep(self):
        """What the phase sweeps."""
        phase, found = self.phase[None], NONE
        if phase == PUSH:
            found = PUSHES
        elif phase == DEMAND or phase == RELAX:
            found = RATES
        elif phase == TURN:
            found = TURNS
        return found

    @ti.func
    def _even(self):
        """Whether the even chunks are on. START counts first, then pairs; where others sweep both, RELAX has been
        through the odd."""
        return self.odd[None] == 0

    @ti.func
    def tasks(self):
        """Chunks that are on, or blocks of rows."""
        found = blocks(self.o.state.count[None])
        if self._sweep() != NONE:
            found = (self.chunks[None] + 1) // 2 if self._even() else ti.max(self.chunks[None] // 2, 1)
        return found

    @ti.func
    def work(self, task, dt, lists: ti.template()):
        """A chunk's or a block's share of the phase."""
        sweep, after, chunk, first, end = self._sweep(), NONE, 0, task, task + 1
        if sweep != NONE:
            chunk = 2 * task + self.odd[None]
            first, end = self._whole(chunk)
            after = self._after()
        elif self.phase[None] == START:
            if self._even():
                self._count(task, lists)
                end = first
            else:
                self._pair(task, lists)
        for turn in range(2):  # both sweeps by one piece of code, for it is dear to compile
            if sweep != NONE:
                self._over_chunk(chunk, sweep, dt, lists)
            if turn == 0:
                for part in range(first, end):
                    low, high = rows(part, self.o.state.count[None])
                    if sweep != NONE:
                        low, high = self.bound[part], self.bound[part + 1]
                    self._over_rows(part, low, high, dt, lists)
            sweep = after

    @ti.func
    def _over_chunk(self, chunk, sweep, dt, lists: ti.template()):
        for i in range(self.bound[chunk], self.bound[chunk + 1]):
            if sweep == PUSHES:
                self._sweep_pushes(i, lists)
            elif sweep == RATES:
                self._sweep_rates(i, lists)
            elif ti.static(self.spins):
                self._sweep_turns(i, dt, lists)

    @ti.func
    def _whole(self, chunk):
        """(first, end) chunk whose sums are whole once this one is swept."""
        first, end = chunk, ti.min(chunk + 2, self.chunks[None])
        if self._even() and self.phase[None] != RELAX:
            end = first
        elif chunk == 1:
            first = 0
        return first, end

    @ti.func
    def _after(self):
        """The next phase's sweep, of the chunks that are on."""
        found = NONE
        if self.phase[None] == PUSH and not self._even():
            found = RATES
        elif self.phase[None] == RELAX and self.led[None]:
            found = PUSHES
        return found

    @ti.func
    def decide(self):
        """What comes next; whether anything does."""
        phase, more = self.phase[None], True
        if self._even() and phase == START:
            self._cut()
            self.odd[None] = 1
        elif self._even() and phase != RELAX and self._sweep() != NONE:
            self.odd[None] = 1
        else:
            if phase == PUSH:
                self.led[None] = self._leads()
            more = self._next()
            self.odd[None] = phase == RELAX and self.phase[None] == PUSH and self.led[None]
        return more

    @ti.func
    def _leads(self):
        """Whether another iteration is sure to follow the one that is on; if not all the same, `_begin` forgets it."""
        way = self.way[None]
        sure = self.iterations[way] > 0 and self.calm[None] == 0 and self.left[None] > FAR * self.tolerance[None]
        return sure and not (self.spins and way == 1)

    @ti.func
    def _count(self, block, lists: ti.template()):
        """How much room the pairs of a block of rows need, and how far they reach."""
        first, end = rows(block, self.o.state.count[None])
        fours, last = 0, first
        for i in range(first, end):
            middle, stop = self.middle[i], self.pairs.stop[i]
            if i % GRAIN == 0:
                last = i
            if middle < stop:
                last = ti.max(last, lists.neighbour[stop - 1])
            self.farthest[i // GRAIN] = last
            fours += (stop - middle + LANES - 1) // LANES
        self.fours[block + 1] = fours

    @ti.func
    def _cut(self):
        """Room for each block; and rows into chunks of like length: a multiple of four of them, if so many can be."""
        self.fours[0] = 0
        for block in range(blocks(self.o.state.count[None])):
            self.fours[block + 1] += self.fours[block]
        self._cut_by(BLOCK)
        whole = self.chunks[None] // 4 * 4
        if whole > 0:
            self._cut_by((self.o.state.count[None] + whole - 1) // whole)

    @ti.func
    def _cut_by(self, least):
        """Into chunks of at least that many rows; an empty one follows the last."""
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
        self.chunks[None], self.bound[chunks + 1] = chunks, count

    @ti.func
    def _pair(self, block, lists: ti.template()):
        """The pairs of a block of rows."""
        first, end = rows(block, self.o.state.count[None])
        four = self.fours[block]
        for i in range(first, end):
            lists.start[i] = four
            middle, mass = self.middle[i], self.mass[i]
            pairs = self.pairs.stop[i] - middle
            whole = (pairs + LANES - 1) // LANES
            for k in range(whole):
                for n in ti.static(range(LANES)):
                    given = LANES * k + n < pairs
                    at = middle + LANES * k + n if given else middle
                    lists.near[four + k, n] = lists.neighbour[at] if given else i
                    lists.pull[four + k, n] = mass * lists.slope[at] if given else 0.0
            four += whole
        lists.start[end] = four  # as the next block writes, too

    @ti.func
    def _sweep_rates(self, i, lists: ti.template()):
        own, place, total = self.o.u[i], self.pairs.place[i], self.sums[i]
        for k in range(lists.start[i], lists.start[i + 1]):
            for n in ti.static(range(LANES)):
                j = lists.near[k, n]
                rate = self._rate_of(own, place, j, lists.pull[k, n])
                total += rate
                self.sums[j] = self.sums[j] + rate
        self.sums[i] = total

    @ti.func
    def _sweep_pushes(self, i, lists: ti.template()):
        own, place, total = self.o.guess[i], self.pairs.place[i], self.sums[i]
        for k in range(lists.start[i], lists.start[i + 1]):
            for n in ti.static(range(LANES)):
                j = lists.near[k, n]
                push = self._push_of(own, place, j, lists.pull[k, n])
                total += push
                self.sums[j] = self.sums[j] - push
        self.sums[i] = total

    @ti.func
    def _sweep_turns(self, i, dt, lists: ti.template()):
        own, u, place, total = self.pushed[i], self.o.u[i], self.pairs.place[i], self.sums[i]
        for k in range(lists.start[i], lists.start[i + 1]):
            for n in ti.static(range(LANES)):
                j = lists.near[k, n]
                push = self._turn_of(own, u, place, dt, j, lists.pull[k, n])
                total += push
                self.sums[j] = self.sums[j] - push
        self.sums[i] = total

    @ti.func
    def _parts(self):
        return self.chunks[None]

    @ti.func
    def _begin(self, i, way):
        Projection._begin(self, i, way)
        self.sums[i] = ti.Vector([0.0, 0.0, 0.0, 0.0])

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
