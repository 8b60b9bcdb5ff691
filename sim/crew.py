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
class Lists:
    """Fields over pairs, by name. They grow now and then: new fields are new Lists, for which kernels are compiled."""

    def __init__(self, **fields):
        self.__dict__.update(fields)


@ti.data_oriented
class Crew:
    """Runs a job: phases one after another, each in tasks, which any thread may take.

    Taichi wakes its threads anew for each parallel loop, 80 to 200 us here, as much as a sweep over 5,000 particles
    takes. A thread of the crew waits without a task in hand, and not for long: threads that come late, go home, or
    never come lock nothing up. Where there is no crew (GPU), each phase is a kernel call of its own.

    A job has, all @ti.func:
        begin()                  before the first phase, on one thread
        count()                  rows; a phase has at most as many tasks as they have blocks
        tasks()                  of the phase
        work(task, dt, lists)    one of them; see `rows` for those that are blocks of rows
        decide() -> bool         after each phase, on one thread: sets the next; whether there is one
    """

    def __init__(self):
        settings = runtime.running() or {}
        self.awake = settings.get("arch") == "cpu"
        self.turns = TURNS * min(settings.get("threads", 1), runtime.cores())
        self.ticket, self.left, self.over = (ti.field(ti.i32, ()) for _ in range(3))

    def run(self, job, dt: float, lists: Lists) -> None:
        """All phases of a job, over pairs."""
        more = self._run(job, 1, dt, lists)
        while more:
            more = self._run(job, 0, dt, lists)

    @ti.kernel
    def _run(self, job: ti.template(), begin: ti.i32, dt: float, lists: ti.template()) -> ti.i32:
        """All phases, or one where there is no crew; whether there are more."""
        count = job.count()
        end = blocks(count)
        if begin:
            job.begin()
            self.over[None], self.ticket[None] = 0, end
            self._open(job, end)
        if ti.static(self.awake):
            for turn in range(self.turns):  # each thread comes by once
                if turn % TURNS == 0:
                    ticket = 0
                    while ticket >= 0:
                        ticket = self._take(end)
                        if ticket >= 0:
                            job.work(end - 1 - ticket, dt, lists)
                            if ti.atomic_sub(self.left[None], 1) == 1:
                                self._close(job, end)
        else:
            for task in range(self.left[None]):
                job.work(task, dt, lists)
            ti.loop_config(serialize=True)
            for _ in range(1):
                self._close(job, end)
        return 1 - self.over[None]

    @ti.func
    def _take(self, end):
        """A ticket of the phase that is open; -1 when all is done, or patience is at its end."""
        ticket = ti.atomic_add(self.ticket[None], 1)
        looks = 0
        while ticket >= end and looks < PATIENCE:
            looks += 1
            if ti.atomic_add(self.over[None], 0) != 0:  # adds nothing: a read that is never left out
                looks = PATIENCE
            elif ti.atomic_add(self.ticket[None], 0) < end:
                ticket = ti.atomic_add(self.ticket[None], 1)
        return ticket if ticket < end else -1

    @ti.func
    def _close(self, job: ti.template(), end):
        """After a phase's last task: open the next, if there is one."""
        if job.decide():
            self._open(job, end)
        else:
            ti.atomic_add(self.over[None], 1)

    @ti.func
    def _open(self, job: ti.template(), end):
        """Tickets of a phase run from end - tasks to end - 1: at `end` and beyond, all are taken, whatever phase a
        thread believes in. Tasks are counted down, so that whoever does the last one need not ask how many there were:
        by then the next phase may be open, and it has others."""
        tasks = job.tasks()
        self.left[None] = tasks
        ti.atomic_min(self.ticket[None], end - tasks)


@ti.func
def blocks(count):
    """Blocks of that many rows; one where there are none."""
    return ti.max((count + BLOCK - 1) // BLOCK, 1)


@ti.func
def rows(block, count):
    """(first, end) row of a block."""
    return block * BLOCK, ti.min((block + 1) * BLOCK, count)
