"""The step as an ordered list of stages."""

from typing import Iterable

from sim.stage import SLOTS, Stage


def in_order(stages: Iterable[Stage]) -> list[Stage]:
    """Stages by slot (see sim.stage.SLOTS for the reasons); within a slot, as they were given."""
    places = list(SLOTS)
    return sorted(stages, key=lambda stage: places.index(stage.slot))
