"""What a method is made of: stages (verbs over rows of state) and their time step limits.

A method is a class registered under a kind. It names the public rows it needs (`rows`), its private ones
(`scratch`), its parameters (`Params`), and returns its stages; the pipeline puts them in order by slot.

    @register("fluid.pressure", "dfsph")
    @ti.data_oriented
    class Dfsph:
        class Params(Model): ...
        rows = ("fluid.x", "fluid.v", "fluid.mass")
        scratch = (Row("fluid.dfsph.pressure", "f", "m^2/s^2", "warm start", saved=True),)
        def __init__(self, build: Build, params: Params): self.x = build.state["fluid.x"] ...
        def stages(self) -> tuple[Stage, ...]: ...
"""

from dataclasses import dataclass, field
from typing import Any, Callable, NamedTuple

from sim.state import State

SLOTS = {
    "source": "particles appear, merge and leave only here: rows are about to be sorted anyway",
    "sort": "rows in cell order, then one list of pairs that every later sweep reads",
    "side": "which face of the cloth each particle is on; pairs across it are cut from the list",
    "prepare": "density, on the positions that the list belongs to",
    "accelerate": "gravity and the scene's terms change velocity; pressure has not spoken yet",
    "cloth": "the sheet in small substeps, water touching it inside them (130:1 masses allow no lagging)",
    "solve": "pressure makes the predicted density right",
    "move": "positions follow velocities",
    "catch": "the last step: nothing passes the sheet, whatever went before",
    "wet": "mass changes hands, after everybody's place for this step is known",
}
"""The order of a step, with the reason of each place."""


class Limit(NamedTuple):
    """A bound on the time step: seconds, and the words that name it in messages."""

    seconds: float
    name: str


class Suspect(NamedTuple):
    """A setting known to fail: how ("exploding", "imploding"), and the words that say why and what to set instead."""

    failure: str
    words: str


@dataclass(frozen=True)
class Stage:
    """One verb of the step. `reads` and `writes` are public row names; a contract test holds them true.

    forget(dt): one that counts time takes dt off again; contact took the step back, and it is gone in halves.
    """

    name: str
    slot: str
    run: Callable[[float], None]
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()
    limit: Callable[[], Limit] | None = None
    forget: Callable[[float], None] | None = None


@dataclass
class Build:
    """What a method is built from: the frozen config, the NumPy scene, the rows, and parts built before it.

    parts: "search" (fluid pair list), "pressure", "cloth", "guests" (see sim.cloth), "contact", ...
    """

    config: Any
    scene: Any
    state: State
    parts: dict[str, Any] = field(default_factory=dict)
