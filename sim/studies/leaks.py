"""The leak sweep: a lump of water against a sheet, for every speed, step and thickness; how many trajectories cross."""

import math
import multiprocessing
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from sim import config, explain, registry, toml
from sim.errors import ConfigError, MissedError
from sim.model import REQUIRED, Model, option, quantity
from sim.studies.ablate import write_table

SCENE = "thrown"
WAY = 0.06
"""[m] That the water goes, or would: through the folds and out again."""
STEPS = (4, 120)
"""Of a throw, fewest and most. At the slowest it gets as far as it gets."""
SOLID = 460.0
"""[kg/m^3] Area density over thickness: that of the card cotton, so that thin cloth is light."""
COLUMNS = (
    "contact", "cloth", "thickness", "speed", "dt", "particles", "steps", "caught", "undone", "tied", "leaks",
    "failure",
)  # fmt: skip
"""Of leaks.csv [m, m/s, s], a row a throw. caught: by the last step, or reflected by the report's; undone: steps taken
back, to be gone in halves; tied: particles pinched in the shortest; leaks: crossings that remained; failure: what else
went wrong."""


class Study(Model):
    """configs/studies/leaks.toml."""

    speed: tuple[float, ...] = quantity(REQUIRED, "speed", gt=0)
    dt: tuple[float, ...] = quantity(REQUIRED, "time", gt=0)
    thickness: tuple[float, ...] = quantity(REQUIRED, "length", gt=0)
    cloth: tuple[Literal["flat", "folded", "moving"], ...] = option(("flat", "folded", "moving"))


def load(quick: bool = False) -> Study:
    """The sweep, with [quick] laid over it where asked. ConfigError: one line that names file and key."""
    path = config.find("studies", "leaks")
    label = f"configs/studies/{path.name}"
    table = toml.read(path, label)
    over = table.pop("quick", {})
    if quick:
        table = toml.lay_over(table, over, label, {})
    try:
        return Study.model_validate(table)
    except ValidationError as error:
        found = explain.problem(error.errors()[0], Study, table)
        raise ConfigError(f"{label}: {found.key}: {found.text}") from None


def run(study: Study, path: Path, threads: int = 0) -> Iterator[list[dict[str, Any]]]:
    """Every throw, those of one contact and thickness in a process of their own, which it yields once on disk."""
    registry.discover()
    path.parent.mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for contact in registry.methods("coupling.contact"):
        for thickness in study.thickness:
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                found = pool.apply(throws, (contact, thickness, study.cloth, study.speed, study.dt, threads))
            rows += found
            write_table(path, COLUMNS, rows)
            yield found


def throws(contact: str, thickness: float, cloths, speeds, dts, threads: int = 0) -> list[dict[str, Any]]:
    """The child: rows of one contact and thickness."""
    from sim import runtime
    from sim.world import World

    runtime.start(threads=threads or None)
    world = World(config.load(SCENE, overrides(contact, thickness)))
    start = world.save()
    rows = []
    for cloth in cloths:
        for speed in speeds:
            for dt in dts:
                world.load(start)
                place(world, cloth, speed)
                named = {"contact": contact, "cloth": cloth, "thickness": thickness, "speed": speed, "dt": dt}
                rows.append(named | throw(world, speed, dt))
    runtime.stop()
    return rows


def overrides(contact: str, thickness: float) -> tuple[str, ...]:
    """What is laid over the scene."""
    return (
        f"coupling.contact={contact}",
        f"cloth.fabric.thickness={thickness}",
        f"cloth.fabric.area_density={SOLID * thickness}",
        "cloth.fabric.fibre_diameter=1e-5",
        "run.dt_limits=false",
        "fluid.dfsph.iterations_max=10",
    )


def place(world: Any, cloth: str, speed: float) -> None:
    """Sheet and water at the start of a throw. flat, folded: the water comes at `speed`, aslant. moving: it is the
    sheet that comes, free, turning and bending as it does."""
    state, sheet = world.state, world.scene.sheet
    u, v = (sheet.uv - 0.5 * sheet.uv.max(0)).T
    x, water = sheet.x.copy(), state["fluid.x"].to_numpy()
    living = int(state.count[None])
    way = speed * np.array([0.3, 0.2, -1.0]) / math.sqrt(1.13)
    moves = np.zeros_like(x)
    if cloth == "folded":
        x[:, 0], x[:, 2] = meander(u)
    water[:living, 2] += x[np.abs(x[:, :2]).max(1) < 0.02, 2].max()
    if cloth == "moving":
        half = u.max()
        moves = speed * np.stack([0.3 * v / half, -0.2 + 0.0 * u, 1.0 + 0.5 * u / half - 0.5 * (v / half) ** 2], 1)
        state["cloth.inv_mass"].from_numpy((1.0 / sheet.mass).astype(np.float32))
        way = np.zeros(3)
    state["cloth.x"].from_numpy(x.astype(np.float32))
    state["cloth.v"].from_numpy(moves.astype(np.float32))
    state["fluid.x"].from_numpy(water)
    speeds = np.zeros_like(water)
    speeds[:living] = way
    state["fluid.v"].from_numpy(speeds)


def meander(u: np.ndarray, wave: float = 0.04, slope: float = math.radians(115.0)) -> tuple[np.ndarray, np.ndarray]:
    """(x, z) along a curve of slope angle `slope` sin(2 pi u/wave): folds that overhang (Langbein & Leopold 1966)."""
    s = np.linspace(u.min(), u.max(), 4001)
    angle = slope * np.sin(2.0 * np.pi * s / wave)
    x = np.concatenate([[0.0], np.cumsum(np.cos(angle)[:-1] * np.diff(s))])
    z = np.concatenate([[0.0], np.cumsum(np.sin(angle)[:-1] * np.diff(s))])
    return np.interp(u, s, x - 0.5 * x[-1]), np.interp(u, s, z - z.mean())


def throw(world: Any, speed: float, dt: float) -> dict[str, Any]:
    """One throw, past the guard: steps of dt until the water would have gone WAY."""
    contact, state = world.build.parts["contact"], world.state
    steps = min(max(math.ceil(WAY / (speed * dt)), STEPS[0]), STEPS[1])
    living, failure, world.stood = int(state.count[None]), "", 0.0
    for _ in range(steps):
        world.go(dt)
    rows = [state["fluid.x"].to_numpy()[: int(state.count[None])], state["cloth.x"].to_numpy()]
    if not all(np.isfinite(values).all() for values in rows):
        failure = "not a number"
    elif world.stood > 0.0:
        failure = "stood still"
    return {"particles": living, "steps": steps, "undone": 0, "tied": 0, **contact.counts(), "failure": failure}


def verdict(rows: list[dict[str, Any]]) -> str:
    """A line a contact: throws, those that leaked, and the slowest water that did."""
    lines = []
    for contact in dict.fromkeys(r["contact"] for r in rows):
        mine = [r for r in rows if r["contact"] == contact]
        leaky = [r for r in mine if r["leaks"]]
        line = f"{contact}: {len(leaky)} of {len(mine)} throws leak"
        if leaky:
            least = min(leaky, key=lambda r: r["speed"] * r["dt"] / r["thickness"])
            way = least["speed"] * least["dt"] / least["thickness"]
            line += f", from {way:.2g} thicknesses a step on ({least['cloth']}, {least['speed']:g} m/s)"
        lines.append(line)
    return "\n".join(lines)


def hold(rows: list[dict[str, Any]]) -> None:
    """MissedError that names the first throw that leaked, or came to nonsense, of a contact that must not leak."""
    tight = {name for name, method in registry.methods("coupling.contact").items() if method.tight}
    wrong = [r for r in rows if r["contact"] in tight and (r["leaks"] or r["failure"])]
    if wrong:
        w = wrong[0]
        raise MissedError(
            f"compare leaks: {w['contact']}, {w['cloth']}, {1e3 * w['thickness']:g} mm, {w['speed']:g} m/s, "
            f"{1e3 * w['dt']:g} ms: {w['failure'] or '%d leaks' % w['leaks']} (and {len(wrong) - 1} more)"
        )
