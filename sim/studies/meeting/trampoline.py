"""A ball of water falls on a stretched sheet: nothing passes, the sheet throws it up, and with less than it brought."""

from typing import Any

from sim.studies.case import Case, Point
from sim.studies.meeting.load import Load
from sim.studies.probe import row


def measure(world: Any) -> dict[str, float]:
    """Figures of the run.

    error   momentum upward that water and sheet have won less the impulses of frame and gravity, over the most that the
            water brought down
    lost    1 - the most momentum upward over the most downward, of the water
    gained  energy of the water, kinetic and of height over the frame, at most after it was turned round, over that at
            the start, less 1: the sheet lends none of its own; 0 where it has less
    strain  the largest of any frame; the fabric has no limit
    caught  share of particle-steps in which the last step acted
    leaks   crossings
    """
    load, particle_steps, strain = Load(world), 0, 0.0
    pull = world.config.space.gravity[2] * (row(world, "mass").sum() + _free_mass(world))
    start, energy, most = load.momentum()[2], _energy(world), 0.0
    down = up = 0.0
    load.begin()
    while world.frame_index < world.frame_count:
        if world.step():
            strain = max(strain, world.build.parts["cloth"].max_strain())
        rises = float((row(world, "mass") * row(world, "v")[:, 2]).sum())
        down, up = min(down, rises), max(up, rises)
        most = max(most, _energy(world)) if rises > 0.0 else most
        particle_steps += int(world.state.count[None])
    counts = world.build.parts["contact"].counts()
    return {
        "error": (load.momentum()[2] - start - load.impulse[2] - load.time * pull) / -down,
        "lost": 1.0 - up / -down,
        "gained": max(most / energy - 1.0, 0.0),
        "strain": strain,
        "caught": counts["caught"] / particle_steps,
        "leaks": counts["leaks"],
    }


def _free_mass(world: Any) -> float:
    """Of the sheet, without what the frame holds [kg]."""
    mass, held = (world.state[f"cloth.{name}"].to_numpy().astype(float) for name in ("mass", "inv_mass"))
    return float(mass[held > 0.0].sum())


def _energy(world: Any) -> float:
    """Of the water, its height counted from the frame [J]."""
    mass, height = row(world, "mass"), row(world, "x")[:, 2] - world.config.cloth.centre[2]
    g = -world.config.space.gravity[2]
    return float((mass * (0.5 * (row(world, "v") ** 2).sum(1) + g * height)).sum())


CASE = Case(
    name="trampoline",
    scene="trampoline",
    reference="momentum: water and sheet win what frame and gravity give; energy: none is made",
    bounds={"error": 1e-3, "lost": 0.25, "gained": 0.0, "caught": 1e-4, "leaks": 0.0},
    measure=measure,
    full=(Point(("run.duration=0.2 s",)),),
    quick=(Point(("fluid.spacing=4 mm", "cloth.spacing=1 cm", "run.duration=0.2 s")),),
)
