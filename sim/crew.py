"""Threads that stay awake through a whole stage: from one loop to the next they shake hands, and no one is woken."""

import taichi as ti

from sim import runtime
from sim.runtime import TURNS

BLOCK = 256
"""Rows that one thread does in a go. Fixed, so that sums of a block, then over the blocks in order, have the same bits
on any number of threads. Less: better shared, more handshakes (0.1 us each)."""
LINE = 16
"""Integers in a line of the cache: tickets of two threads are not in one."""
PATIENCE = 20_000
"""Looks at whether the next phase is open, some 200 us, before a thread goes home: whoever is at its last block has
lost its processor to some other program, and gets it back sooner from a thread that sleeps."""
OVER = -(1 << 30)
"""The phase after the last one; far below zero, where whoever opened the last one and counts it late leaves it."""


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
    never come lock nothing up. Each begins with its own share of the tasks, the same rows in every phase, which lie in
    its processor's cache, and then helps the others. Where there is no crew (GPU), each phase is a kernel call of its
    own.

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
        self.members = min(settings.get("threads", 1), runtime.cores())
        self.ticket = ti.field(ti.i32, LINE * self.members)
        self.tasks, self.left, self.phase = (ti.field(ti.i32, ()) for _ in range(3))

    def run(self, job, dt: float, lists: Lists) -> None:
        """All phases of a job, over pairs."""
        more = self._run(job, 1, dt, lists)
        while more:
            more = self._run(job, 0, dt, lists)

    @ti.kernel
    def _run(self, job: ti.template(), begin: ti.i32, dt: float, lists: ti.template()) -> ti.i32:
        """All phases, or one where there is no crew; whether there are more."""
        end = blocks(job.count())
        if begin:
            job.begin()
            self.phase[None] = 0
            for member in range(self.members):
                self.ticket[LINE * member] = end
            self._open(job, end)
        if ti.static(self.awake):
            for turn in range(self.members * TURNS):  # each thread comes by once
                if turn % TURNS == 0:
                    task = 0
                    while task >= 0:
                        task = self._take(turn // TURNS, end)
                        if task >= 0:
                            job.work(task, dt, lists)
                            if ti.atomic_sub(self.left[None], 1) == 1:
                                self._close(job, end)
        else:
            for task in range(self.left[None]):
                job.work(task, dt, lists)
            ti.loop_config(serialize=True)
            for _ in range(1):
                self._close(job, end)
        return self.phase[None] >= 0

    @ti.func
    def _take(self, member, end):
        """A task of the phase that is open; -1 when all is done, or patience is at its end."""
        task, tried, looks = -1, 0, 0
        while task < 0 and looks < PATIENCE:
            phase = ti.atomic_add(self.phase[None], 0)  # adds nothing: a read that is never left out
            if phase < 0:
                looks = PATIENCE
            elif phase == tried:
                looks += 1
            else:
                tried = phase
                for turn in range(self.members):
                    if task < 0:
                        share = (member + turn) % self.members
                        ticket = ti.atomic_add(self.ticket[LINE * share], 1)
                        if ticket < end:
                            task = self._end_of(share, self.tasks[None]) - end + ticket
        return task

    @ti.func
    def _end_of(self, share, tasks):
        """Where a member's share of a phase's tasks ends."""
        return tasks * (share + 1) // self.members

    @ti.func
    def _close(self, job: ti.template(), end):
        """After a phase's last task: open the next, if there is one."""
        if job.decide():
            self._open(job, end)
        else:
            ti.atomic_min(self.phase[None], OVER)

    @ti.func
    def _open(self, job: ti.template(), end):
        """Tickets of a share run up to `end`: from there on all are taken, whatever phase a thread believes in. Tasks
        are counted down, so that whoever does the last one need not ask how many there were: by then the next phase may
        be open, and it has others. So it may even before this one is counted, and all be over."""
        tasks = job.tasks()
        self.tasks[None] = tasks
        self.left[None] = tasks
        for share in range(self.members):
            size = self._end_of(share, tasks) - self._end_of(share - 1, tasks)
            ti.atomic_min(self.ticket[LINE * share], end - size)
        self._tell()

    @ti.func
    def _tell(self):
        """Those who wait that there are new tickets."""
        ti.atomic_add(self.phase[None], 1)


@ti.func
def blocks(count):
    """Blocks of that many rows; one where there are none."""
    return ti.max((count + BLOCK - 1) // BLOCK, 1)


@ti.func
def rows(block, count):
    """(first, end) row of a block."""
    return block * BLOCK, ti.min((block + 1) * BLOCK, count)
