"""Who is near whom: the protocol of every search, of points now and of boxes (trees) later.

    build()   from scratch: order, structure and candidates
    refit()   things moved a little: the structure stays, bounds and candidates follow; may simply build
    list      PairList: for thing i the candidates list.neighbour[k], list.start[i] <= k < list.stop[i], rising in k

Rows rise by index (grid and trees sort the rows themselves or the answer), so that two searches over equal rows give
equal lists. A list that is too small is enlarged and filled again; nothing is cut short.
"""

from typing import Protocol

from sim.search.pair_list import PairList


class Search(Protocol):
    """What a stage in slot "sort" may rely on."""

    list: PairList

    def build(self) -> None:
        """Order things and list candidates from scratch."""

    def refit(self) -> None:
        """List candidates again after small moves."""
