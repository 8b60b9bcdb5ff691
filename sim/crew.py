"""Threads that stay awake through a whole stage: from one loop to the next they shake hands, and no one is woken."""

import taichi as ti

from sim import runtime
from sim.runtime import TURNS

BLOCK = 256
"""Rows that one thread does in a go. Fixed, so that sums of a block, then over the blocks in order, have the same bits
on any number of threads. Less: better shared, more handshakes (0.1 us each)."""
PATIENCE = 10_000
"""Looks at whether the next phase is open, some 200 us, before a thread goes home: whoever is at its last block has
lost its processor to some other program, and gets it back sooner from a thread that sleeps."""


@ti.data_oriented
class Crew:
    """Runs a job: phases one after another, each over all rows, block by block, which any thread may take.

    Taichi wakes its threads anew for each parallel loop, 80 to 200 us here, as much as a sweep over 5,000 particles
    takes. A thread of the crew waits without a block in hand, and not for long: threads that come late, go home, or
    never come lock nothing up. Where there is no crew (GPU), each phase is a kernel call of its own.

    A job has, all @ti.func:
        begin()                               before the first phase, on one thread
        count()                               rows
        block(block, first, end, dt, lists)   rows first ... end - 1, its share of the phase; lists: three fields
        decide() -> bool                      after each phase, on one thread: sets the next; whether there is one
    """

    def __init__(self):
        settings = runtime.running() or {}
        self.awake = settings.get("arch") == "cpu"
        self.turns = TURNS * min(settings.get("threads", 1), runtime.cores())
        self.ticket, self.done, self.over = (ti.field(ti.i32, ()) for _ in range(3))

    def run(self, job, dt: float, neighbour, weight, slope) -> None:
        """All phases of a job, over pairs (see sim.fluid.pairs), which grow now and then and so are handed in."""
        more = self._run(job, 1, dt, neighbour, weight, slope)
        while more:
            more = self._run(job, 0, dt, neighbour, weight, slope)

    @ti.kernel
    def _run(
        self,
        job: ti.template(),
        begin: ti.i32,
        dt: float,
        neighbour: ti.template(),
        weight: ti.template(),
        slope: ti.template(),
    ) -> ti.i32:
        """All phases, or one where there is no crew; whether there are more."""
        if begin:
            self.ticket[None] = self.done[None] = self.over[None] = 0
            job.begin()
        count = job.count()
        blocks = ti.max((count + BLOCK - 1) // BLOCK, 1)
        if ti.static(self.awake):
            for turn in range(self.turns):  # each thread comes by once
                if turn % TURNS == 0:
                    block = 0
                    while block >= 0:
                        block = self._take(blocks)
                        if block >= 0:
                            first, end = block * BLOCK, ti.min((block + 1) * BLOCK, count)
                            job.block(block, first, end, dt, neighbour, weight, slope)
                            if ti.atomic_add(self.done[None], 1) + 1 == blocks:
                                self._close(job)
        else:
            for block in range(blocks):
                first, end = block * BLOCK, ti.min((block + 1) * BLOCK, count)
                job.block(block, first, end, dt, neighbour, weight, slope)
            ti.loop_config(serialize=True)
            for _ in range(1):
                self._close(job)
        return 1 - self.over[None]

    @ti.func
    def _take(self, blocks):
        """A block of the phase that is open; -1 when all is done, or patience is at its end."""
        block = ti.atomic_add(self.ticket[None], 1)
        looks = 0
        while block >= blocks and looks < PATIENCE:
            looks += 1
            if ti.atomic_add(self.over[None], 0) != 0:  # adds nothing: a read that is never left out
                looks = PATIENCE
            elif ti.atomic_add(self.ticket[None], 0) < blocks:
                block = ti.atomic_add(self.ticket[None], 1)
        return block if block < blocks else -1

    @ti.func
    def _close(self, job: ti.template()):
        """After a phase's last block: open the next, if there is one."""
        if job.decide():
            self.done[None] = 0
            ti.atomic_and(self.ticket[None], 0)
        else:
            ti.atomic_add(self.over[None], 1)
