"""Which boxes may touch a query box: one protocol, several searches, the same sets after the box test.

    build(low, high)     from two vec3 fields [m], a box an entry, grown already by the reach or motion it covers
    refit(low, high)     the same boxes have moved: do as little as the structure allows; may simply build
    leaves_out           bool: whether both take an i32 field more, 0 where a box is not wanted

In a kernel, for a query box [low, high], which may be a point:

    walk = boxes.begin(low, high)
    while walk[0] < walk[1]:
        walk, first, last = boxes.next(walk, low, high)
        for s in range(first, last):
            p = boxes.slots[s]

meets every box p that overlaps the query: others too, some more than once, in an order that depends on the search. Test
overlap(...), and let no result depend on the order (ties go to the lower number). `sim.search.candidates` lists the
boxes of many queries instead, each once and rising. A walk compiles into where it stands: have one in a kernel.
"""

from typing import Protocol

import taichi as ti

from sim.maths.order import more


class BoxSearch(Protocol):
    """What users of kind "search.boxes" may rely on. Made by Search(box_count); begin and next are @ti.func."""

    slots: ti.Field
    leaves_out: bool

    def build(self, low, high) -> None:
        """From scratch."""

    def refit(self, low, high) -> None:
        """After the boxes moved."""

    def begin(self, low, high):
        """Vector of i32: place and end of a walk, and what else the search needs."""

    def next(self, walk, low, high):
        """(walk, first, last): one step on, and the stretch of `slots` met there, maybe empty."""


@ti.func
def overlap(low, high, low_other, high_other):
    """Do two closed boxes touch?"""
    apart = more(low - high_other, low_other - high)
    return more(more(apart[0], apart[1]), apart[2]) <= 0.0
