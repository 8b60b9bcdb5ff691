"""What a stage declares is true: with its undeclared rows filled twice over, its writes agree and those rows stay."""

import numpy as np
import pytest

from tests.spawned import open_world, spawn

FILLINGS = ({"i": 0, "f": 0.5, "v": 0.5, "m": 3}, {"i": 1, "f": 2.0, "v": -1.5, "m": 7})


def _set(world, kept: dict) -> None:
    for name, values in kept.items():
        world.state[name].from_numpy(values)


def _under(world, stage, kept: dict, count: int, filling: dict, dt: float) -> tuple[dict, list[str]]:
    """(declared public writes after the stage, undeclared public rows that it changed)."""
    from sim.state import ROWS

    _set(world, kept)
    if world.state.count is not None:
        world.state.count[None] = count
    declared = set(stage.reads) | set(stage.writes)
    filled = {}
    for name, row in world.state.rows.items():
        if name in ROWS and name not in declared:
            filled[name] = np.full_like(kept[name], filling[row.dtype])
    _set(world, filled)
    stage.run(dt)
    touched = [n for n, values in filled.items() if not np.array_equal(world.state[n].to_numpy(), values)]
    return {n: world.state[n].to_numpy() for n in stage.writes if n in world.state}, touched


def _check(scene: str, frames: int) -> list[str]:
    """A line for each broken declaration. Each stage runs from the same state, the middle of a step at `frames`."""
    world = open_world(scene, quick=True)
    for _ in range(frames):
        world.advance()
    dt, broken = 5e-4, []
    for stage in world.stages:
        kept = {name: world.state[name].to_numpy() for name in world.state.rows}
        count = int(world.state.count[None]) if world.state.count is not None else 0
        runs = [_under(world, stage, kept, count, filling, dt) for filling in FILLINGS]
        broken += [f"{stage.name} changes {name}" for _, touched in runs for name in touched]
        one, two = (writes for writes, _ in runs)
        broken += [
            f"{stage.name} reads something undeclared into {n}" for n in one if not np.array_equal(one[n], two[n])
        ]
        _set(world, kept)
        if world.state.count is not None:
            world.state.count[None] = count
        stage.run(dt)
    return broken


@pytest.mark.parametrize("scene, frames", [("seep", 5), ("tablecloth", 1), ("curtain", 1), ("explosion", 2)])
def test_stages_do_what_they_declare(scene, frames):
    assert spawn(_check, scene, frames) == []


def test_slots_are_in_order():
    from sim.pipeline import in_order
    from sim.stage import Stage

    stages = [Stage("b", "move", print), Stage("a", "source", print), Stage("c", "move", print)]
    assert [stage.name for stage in in_order(stages)] == ["a", "b", "c"]
