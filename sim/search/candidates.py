"""The boxes of many queries as one flat list."""

import taichi as ti

from sim.runtime import TURNS
from sim.search.boxes import overlap
from sim.search.pair_list import BLOCK, PairList

ROOM = 16
"""Candidates a query, on average, that there is space for at first."""


@ti.data_oriented
class Candidates:
    """Boxes that touch each query box, each once, numbers rising: the same list from every search.

    find(low, high, count)   queries [low[q], high[q]], q < count [m]; the boxes as the search was last built from them
    list                     PairList: of query q the boxes list.neighbour[k], list.start[q] <= k < list.stop[q]

    The list is enlarged where it is too small, never cut: fetch list.neighbour anew after each find.
    """

    def __init__(self, boxes, box_low, box_high, capacity: int):
        self.boxes, self.box_low, self.box_high = boxes, box_low, box_high
        self.list = PairList(capacity, ROOM)

    def find(self, low, high, count: int) -> None:
        """List the boxes of the first `count` queries."""
        self.list.fill(lambda neighbour, room: self._fill(low, high, count, neighbour, room))

    @ti.kernel
    def _fill(
        self, low: ti.template(), high: ti.template(), count: ti.i32, neighbour: ti.template(), room: ti.i32
    ) -> ti.i32:
        """Block by block; returns the entries that the fullest block wants."""
        wanted = 0
        for turn in range((count + BLOCK - 1) // BLOCK * TURNS):
            if turn % TURNS == 0:
                block = turn // TURNS
                begin, cursor = block * BLOCK * room, block * BLOCK * room
                for q in range(block * BLOCK, ti.min((block + 1) * BLOCK, count)):
                    self.list.start[q] = cursor
                    end = self._meet(low[q], high[q], neighbour, cursor, begin + BLOCK * room)
                    if end <= begin + BLOCK * room:
                        end = _in_order(neighbour, cursor, end)
                    self.list.stop[q] = end
                    cursor = end
                ti.atomic_max(wanted, cursor - begin)
        return wanted

    @ti.func
    def _meet(self, low, high, neighbour: ti.template(), cursor, space_end):
        """Write the boxes met from `cursor` on, as far as there is space; where they end."""
        walk = self.boxes.begin(low, high)
        while walk[0] < walk[1]:
            walk, first, last = self.boxes.next(walk, low, high)
            for s in range(first, last):
                p = self.boxes.slots[s]
                if overlap(low, high, self.box_low[p], self.box_high[p]):
                    if cursor < space_end:
                        neighbour[cursor] = p
                    cursor += 1
        return cursor


@ti.func
def _in_order(neighbour: ti.template(), begin, end):
    """Sort entries begin..end by insertion (rows are short, or sorted already) and drop repeats; the new end."""
    kept = begin
    for k in range(begin, end):
        p, at, known = neighbour[k], kept, False
        while at > begin and neighbour[at - 1] >= p and not known:
            known = neighbour[at - 1] == p
            at -= 1
        if not known:
            for m in range(kept - at):
                neighbour[kept - m] = neighbour[kept - m - 1]
            neighbour[at] = p
            kept += 1
    return kept
