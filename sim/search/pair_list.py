"""One flat list of candidates, filled block by block so that one pass suffices."""

import taichi as ti

from sim.errors import CapacityError

BLOCK = 256
"""Rows filled by one thread in a go. Rows of a block lie end to end; a block starts at block * BLOCK * room.
More: better packed, and coarser to share between threads."""


def first_room(support: float) -> int:
    """Entries a row to begin with: the support sphere's volume in dx^3, and a third for disorder."""
    return int(4.2 * support**3 * 1.33) + 1


@ti.data_oriented
class PairList:
    """Candidates of row i: neighbour[k] for start[i] <= k < stop[i].

    start, stop   i32 fields (capacity,)
    neighbour     i32 ndarray; replaced by a longer one when a list does not fit, so fetch it at each use
    room          entries a row on average that a block has space for
    """

    def __init__(self, capacity: int, rows: int, room: int):
        self.capacity = capacity
        self.start = ti.field(ti.i32, shape=max(capacity, 1))
        self.stop = ti.field(ti.i32, shape=max(capacity, 1))
        self.room = room
        self.rows = 0
        self.neighbour = None
        self.reserve(rows, room)

    def reserve(self, rows: int, room: int) -> None:
        """Make space for `rows` rows of `room` entries. CapacityError where memory or 32-bit indices end."""
        blocks = -(-max(min(rows, self.capacity), 1) // BLOCK)
        length = blocks * BLOCK * room
        if length >= 2**31:
            raise CapacityError(f"search: {rows} particles with {room} neighbours each; use a larger spacing")
        try:
            self.neighbour = ti.ndarray(ti.i32, length)
        except RuntimeError as error:
            raise CapacityError(f"search: no memory for {length} pairs; use a larger spacing") from error
        self.rows, self.room = blocks * BLOCK, room

    def fill(self, kernel, count: int) -> None:
        """Run kernel(neighbour, room) -> entries that the fullest block wants, until the list holds them all."""
        if count > self.rows:
            self.reserve(max(count, 3 * self.rows // 2), self.room)
        wanted = kernel(self.neighbour, self.room)
        while wanted > self.room * BLOCK:
            self.reserve(self.rows, wanted * 9 // (8 * BLOCK) + 1)
            wanted = kernel(self.neighbour, self.room)
