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
    """Candidates of row i: neighbour[k] for start[i] <= k < stop[i]. They rise, but where periodic space closes a ring,
    and from middle[i] on they lie behind i.

    start, stop, middle   i32 fields (capacity,)
    neighbour     i32 field; replaced by a longer one when a list does not fit, so fetch it at each use and hand it to
                  kernels as a ti.template() argument
    room          entries a row, on average over a block, that there is space for
    """

    def __init__(self, capacity: int, room: int):
        self.blocks = -(-max(capacity, 1) // BLOCK)
        self.start, self.stop, self.middle = (ti.field(ti.i32, shape=max(capacity, 1)) for _ in range(3))
        self.reserve(room)

    def reserve(self, room: int) -> None:
        """Make space for `room` entries a row. CapacityError where memory or 30-bit indices end."""
        length = self.blocks * BLOCK * room
        try:
            if length >= 2**30:
                raise RuntimeError
            self.neighbour = ti.field(ti.i32, shape=length)
        except RuntimeError as error:
            raise CapacityError(f"search: no room for {length} pairs; use a larger fluid.spacing") from error
        self.room = room

    def fill(self, kernel) -> None:
        """Run kernel(neighbour, room) -> entries that the fullest block wants, until the list holds them all."""
        wanted = kernel(self.neighbour, self.room)
        while wanted > self.room * BLOCK:
            self.reserve(wanted * 9 // (8 * BLOCK) + 1)
            wanted = kernel(self.neighbour, self.room)
