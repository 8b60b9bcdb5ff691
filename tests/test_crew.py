"""The crew: every row in every phase once, phase after phase, on any number of threads."""

import numpy as np
import pytest
import taichi as ti
from spawned import spawn

from sim import runtime
from sim.crew import BLOCK, Crew, Lists, blocks, rows

ROWS, PHASES, FEW = 12 * BLOCK + 7, 40, 3
STEPS, MOST = 5000, 4


@ti.data_oriented
class Job:
    """Counts visits of each row in each phase, and phases that begin before the last is done. Every third phase has
    tasks of another size."""

    def __init__(self):
        self.crew = Crew()
        self.phase = ti.field(ti.i32, ())
        self.visits = ti.field(ti.i32, (PHASES, ROWS))
        self.early = ti.field(ti.i32, ())
        self.lists = Lists(visits=self.visits)

    def run(self):
        """A field that this job does not look at stands for the lists of pairs."""
        self.crew.run(self, 0.0, self.lists)

    @ti.func
    def begin(self):
        self.phase[None] = 0

    @ti.func
    def count(self):
        return ROWS

    @ti.func
    def tasks(self):
        return FEW if self.phase[None] % 3 == 2 else blocks(ROWS)

    @ti.func
    def work(self, task, dt, lists: ti.template()):
        first, end = rows(task, ROWS)
        if self.phase[None] % 3 == 2:
            first, end = task * ROWS // FEW, (task + 1) * ROWS // FEW
        phase = self.phase[None]
        for i in range(ROWS):
            if phase > 0:
                if self.visits[phase - 1, i] != 1:
                    self.early[None] += 1
        for i in range(first, end):
            self.visits[phase, i] += 1

    @ti.func
    def decide(self):
        self.phase[None] += 1
        return self.phase[None] < PHASES


def start(threads):
    """With a crew of so many, though there may be fewer processors."""
    runtime.cores = lambda: threads
    runtime.start(threads=threads)


def work(threads, awake):
    start(threads)
    job = Job()
    job.crew.awake = awake
    counts = []
    for _ in range(20):
        job.visits.fill(0)
        job.run()
        counts.append(job.visits.to_numpy())
    return np.array(counts), job.early[None]


@pytest.mark.parametrize("threads, awake", [(1, True), (2, True), (8, True), (2, False)])
def test_a_crew_does_every_row_once_and_in_turn(threads, awake):
    """Also where there is none: each phase a call of its own, as on a GPU."""
    counts, early = spawn(work, threads=threads, awake=awake)
    assert (counts == 1).all() and early == 0


@ti.data_oriented
class Stair:
    """Thousands of phases with next to no work, each of as many tasks as the last or one less: a thread that has done
    the last task but one has often yet to ask what is left when the next phase is open."""

    def __init__(self, steps=STEPS):
        self.crew, self.steps = Crew(), steps
        self.phase, self.done = ti.field(ti.i32, ()), ti.field(ti.i32, STEPS)
        self.lists = Lists(done=self.done)

    @ti.func
    def begin(self):
        self.phase[None] = 0

    @ti.func
    def count(self):
        return MOST * BLOCK

    @ti.func
    def tasks(self):
        return MOST - self.phase[None] % 3

    @ti.func
    def work(self, task, dt, lists: ti.template()):
        self.done[self.phase[None]] += 1

    @ti.func
    def decide(self):
        self.phase[None] += 1
        return self.phase[None] < self.steps


@ti.data_oriented
class Late(Crew):
    """Tells so late of a phase that others may have found it, done it and closed the last one."""

    @ti.func
    def _tell(self):
        for _ in range(20_000):
            ti.atomic_add(self.phase[None], 0)
        ti.atomic_add(self.phase[None], 1)


def climb(threads):
    runtime.start(threads=threads)
    job, wrong = Stair(), 0
    for _ in range(40):
        job.done.fill(0)
        job.crew.run(job, 0.0, job.lists)
        wrong += int((job.done.to_numpy() != MOST - np.arange(STEPS) % 3).sum())
    return wrong


def hear_late(threads):
    """Phases that are not done as they should be. If the last one were open again, this would not end."""
    start(threads)
    job, wrong = Stair(3), 0
    job.crew = Late()
    for _ in range(300):
        job.done.fill(0)
        job.crew.run(job, 0.0, job.lists)
        wrong += int((job.done.to_numpy()[:3] != [MOST, MOST - 1, MOST - 2]).sum())
    return wrong


def test_who_tells_late_of_the_last_phase_does_not_open_it_again():
    assert spawn(hear_late, threads=8) == 0


def test_a_phase_ends_with_its_own_last_task_however_many_the_next_has():
    assert spawn(climb, threads=2) == 0
