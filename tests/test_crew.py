"""The crew: every block of every phase once, phase after phase, on any number of threads."""

import numpy as np
import pytest
import taichi as ti
from spawned import spawn

from sim import runtime
from sim.crew import Crew
from sim.runtime import TURNS

BLOCKS, PHASES = 13, 400


@ti.data_oriented
class Job:
    """Adds to each block what the whole of the phase before came to; the last phase's number is in `phase`."""

    def __init__(self):
        self.crew = Crew()
        self.phase = ti.field(ti.i32, ())
        self.visits = ti.field(ti.i32, (PHASES, BLOCKS))
        self.early = ti.field(ti.i32, ())

    @ti.kernel
    def run(self):
        self.crew.muster()
        self.phase[None] = 0
        for turn in range(self.crew.turns):
            if turn % TURNS == 0:
                block = 0
                while block >= 0:
                    block = self.crew.take(BLOCKS)
                    if block >= 0:
                        self.visit(block)
                        if self.crew.last(BLOCKS):
                            if self.phase[None] == PHASES - 1:
                                self.crew.dismiss()
                            else:
                                self.phase[None] += 1
                            self.crew.open()

    @ti.func
    def visit(self, block):
        phase = self.phase[None]
        for other in range(BLOCKS):
            if phase > 0:
                if self.visits[phase - 1, other] != 1:
                    self.early[None] += 1
        self.visits[phase, block] += 1


def work(threads):
    runtime.start(threads=threads)
    job = Job()
    job.crew.turns = threads * TURNS  # more of them than there are processors, too
    counts = []
    for _ in range(20):
        job.visits.fill(0)
        job.run()
        counts.append(job.visits.to_numpy())
    return np.array(counts), job.early[None]


@pytest.mark.parametrize("threads", [1, 2, 8])
def test_a_crew_does_every_block_once_and_in_turn(threads):
    counts, early = spawn(work, threads=threads)
    assert (counts == 1).all() and early == 0
