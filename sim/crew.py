"""Threads that stay awake through a whole stage: from one loop to the next they shake hands, and no one is woken."""

import taichi as ti

from sim import runtime
from sim.runtime import TURNS

BLOCK = 256
"""Rows that one thread does in a go. Fixed, so that sums of a block, then over the blocks in order, have the same bits
on any number of threads. Less: better shared, more handshakes (0.1 us each)."""
PATIENCE = 10_000
"""Looks at whether the next phase is open, some 200 us, before a thread goes home: whoever is at its
last block has lost its processor to some other program, and gets it back sooner from a thread that sleeps."""


@ti.data_oriented
class Crew:
    """Phases one after another, each of `blocks` blocks, which any thread may take.

    Taichi wakes its threads anew for each parallel loop, 80 to 200 us here, as much as a sweep over 5,000 particles
    takes. A thread of the crew waits without a block in hand, and not for long: threads that come late, go home, or
    never come lock nothing up. Where there is no crew (GPU), each phase is a kernel call of its own.

        crew.muster()                        in a serial loop
        for turn in range(crew.turns):       one parallel loop, in which each thread comes by once
            if turn % TURNS == 0:
                block = 0
                while block >= 0:
                    block = crew.take(blocks)
                    if block >= 0:
                        (the work)
                        if crew.last(blocks):
                            (what the next phase is; crew.dismiss() if there is none)
                            crew.open()
    """

    def __init__(self):
        settings = runtime.running() or {}
        self.awake = settings.get("arch") == "cpu"
        self.turns = TURNS * min(settings.get("threads", 1), runtime.cores())
        self.ticket, self.done, self.over = (ti.field(ti.i32, ()) for _ in range(3))

    @ti.func
    def muster(self):
        """Before the first phase."""
        self.ticket[None] = self.done[None] = self.over[None] = 0

    @ti.func
    def take(self, blocks):
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
    def last(self, blocks):
        """Block done. Whether it was its phase's last, so that this thread alone decides what comes."""
        return ti.atomic_add(self.done[None], 1) + 1 == blocks

    @ti.func
    def open(self):
        """Let the next phase begin, if there is one."""
        if self.over[None] == 0:
            self.done[None] = 0
            ti.atomic_and(self.ticket[None], 0)

    @ti.func
    def dismiss(self):
        """There is no next phase."""
        ti.atomic_add(self.over[None], 1)


@ti.func
def block_count(count):
    """Blocks of `count` rows, at least one."""
    return ti.max((count + BLOCK - 1) // BLOCK, 1)
