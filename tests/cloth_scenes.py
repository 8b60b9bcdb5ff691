"""Scenes of cloth alone for test_cloth.py, each run in a process of its own; a scene returns plain numbers."""

import math
from types import SimpleNamespace

import numpy as np

AREA_DENSITY, STRETCH, GRAVITY = 0.15, 2000.0, 9.81


def corners(clip=0.015):
    return {"corners": SimpleNamespace(where="corners", clip=clip)}


def cloth(size=(0.2, 0.2), spacing=0.02, slack=0.0, pins=None, strain_limit=None, stretch=STRETCH, **more):
    """config.cloth without a file."""
    fabric = SimpleNamespace(area_density=AREA_DENSITY, thickness=4e-4, stretch=stretch, bending=1e-5)
    plain = dict(centre=(0.0, 0.0, 0.2), normal=(0.0, 0.0, 1.0), fold=None, bending="flexion", fabric=fabric)
    counts = tuple(round(side / spacing) + 1 for side in size)
    given = dict(
        size=size, spacing=spacing, slack=slack, pins=pins or {}, strain_limit=strain_limit, node_counts=counts
    )
    return SimpleNamespace(**{**plain, **given, **more})


def solver(
    section, gravity=(0.0, 0.0, -GRAVITY), substep=1e-4, damping=0.2, solids=None, inv_mass=None, tau=0.0, **start
):
    """An Xpbd on rows of its own, Taichi started."""
    from sim import runtime
    from sim.cloth.xpbd import Xpbd
    from sim.scene.cloth import build_sheet
    from sim.scene.solids import build_solids
    from sim.stage import Build
    from sim.state import ROWS, State

    runtime.start(**{"threads": 1, "precision": "f64", **start})
    sheet = build_sheet(section)
    state = State([ROWS[name] for name in Xpbd.rows], {"cloth": len(sheet.x)})
    weights = sheet.inv_mass if inv_mass is None else inv_mass(sheet)
    for name, value in (("x", sheet.x), ("mass", sheet.mass), ("inv_mass", weights)):
        state[f"cloth.{name}"].from_numpy(value.astype(np.float32 if start.get("precision") == "f32" else np.float64))
    config = SimpleNamespace(cloth=section, space=SimpleNamespace(gravity=gravity), run=SimpleNamespace(dt_limits=True))
    scene = SimpleNamespace(sheet=sheet, solids=build_solids(solids or {}))
    build = Build(config, scene, state)
    made = Xpbd(build, Xpbd.Params(substep_max=substep, damping=damping, bending_retardation=tau))
    return made, sheet, state


def free(sheet):
    return 1.0 / sheet.mass


def pulled():
    """A sheet in grips that slide sideways, hung along u, then stretched by 0.4 %: each (strain along, across, N/m)."""
    from cloth_grips import Grips

    made, sheet, state = solver(cloth(), gravity=(GRAVITY, 0.0, 0.0), substep=2e-5, inv_mass=free)
    grips = Grips(made, sheet)
    made.guests.append(grips)
    found = []
    for strain in (None, 0.004):
        if strain:
            made.gravity = (0.0, 0.0, 0.0)
            grips.stretch(strain)
        for _ in range(40):
            made.advance(0.01, 100.0, 0.0)
        x = state["cloth.x"].to_numpy().reshape(*sheet.shape, 3)
        along = (x[-1, :, 0] - x[0, :, 0]).mean() / 0.2 - 1.0
        across = (x[:, -1, 1] - x[:, 0, 1]).mean() / 0.2 - 1.0
        found.append((along, across, pull(sheet, x.reshape(-1, 3)) / 0.2 / (0.2 * (1.0 + along))))
    return found


def pull(sheet, x):
    """sum over springs of tension times extent along u [N m]: length times force through any cut."""
    from sim.scene.cloth import spring_list

    springs = spring_list(sheet)
    d = x[springs.ends[:, 1]] - x[springs.ends[:, 0]]
    length = np.linalg.norm(d, axis=1)
    return (springs.stiffness * (length - springs.rest) * d[:, 0] ** 2 / length).sum()


def oscillation():
    """Period of a strip's breathing, both ends free: a 2-node spring in disguise (three rows, the middle at rest)."""
    section = cloth(size=(0.04, 0.04), bending="none")
    made, sheet, state = solver(section, gravity=(0.0, 0.0, 0.0), substep=1e-6, damping=0.0, inv_mass=_middle_held)
    x = sheet.x.copy()
    x[:, 0] *= 1.001
    state["cloth.x"].from_numpy(x)
    edge, times = [], np.arange(1, 400) * 2e-6
    for _ in times:
        made.run(2e-6)
        edge.append(float(state["cloth.v"][7][0]))
    turns = np.flatnonzero(np.diff(np.sign(edge)))
    return 2.0 * float(np.diff(times[turns]).mean())


def _middle_held(sheet):
    """Of 3 x 3 nodes only the middle of the last row moves."""
    weights = np.zeros(9)
    weights[7] = 1.0 / sheet.mass[7]
    return weights


def strip(length, distance):
    """Sag of a narrow strip hung from both ends, its ends nearer than it is long."""
    ends = tuple((i, j) for i in (0, 40) for j in range(3))
    section = cloth(
        (length, length / 20), length / 40, 1.0 - distance / length, {"e": SimpleNamespace(where=ends, clip=0.0)}
    )
    made, sheet, state = solver(section, substep=5e-5)
    made.settle(1.5)
    x = state["cloth.x"].to_numpy().reshape(*sheet.shape, 3)
    return float(x[0, 1, 2] - x[20, 1, 2])


def tumbling():
    """Of a free, crumpling, turning sheet with bending damped: linear and angular momentum, before and after; energy,
    strain. And what share of its speed a fold four spacings wide keeps in one step, over what it ought to."""
    made, sheet, state = solver(cloth(strain_limit=0.1), gravity=(0.0, 0.0, 0.0), damping=20.0, inv_mass=free, tau=0.1)
    kept = fold_slowed(made, sheet, state)
    rng = np.random.default_rng(1)
    v = 0.5 * rng.standard_normal(sheet.x.shape) + np.cross([3.0, 1.0, 2.0], sheet.x) + [1.0, -0.5, 0.3]
    state["cloth.v"].from_numpy(v)
    before = momenta(sheet, state)
    for _ in range(20):
        made.run(2e-3)
    return before, momenta(sheet, state), made.kinetic_energy(), made.max_strain(), kept


def fold_slowed(made, sheet, state, dt=2e-5):
    """Share of its speed that z ~ sin(k x), four spacings long, loses in dt, over B tau k^4 dt/rho_A of the mesh."""
    wave = np.sin(0.5 * np.pi * np.round(sheet.uv[:, 0] / sheet.spacing))
    for name, size in (("x", 1e-6), ("v", 1e-3)):
        rows = sheet.x.copy() if name == "x" else np.zeros_like(sheet.x)
        rows[:, 2] += size * wave
        state[f"cloth.{name}"].from_numpy(rows)
    made.advance(dt, 0.0, 0.0)
    inner = (np.abs(wave) > 0.5).reshape(sheet.shape)[4:7, 2:-2]
    lost = (
        1.0 - (state["cloth.v"].to_numpy()[:, 2] / (1e-3 * np.where(wave, wave, 1.0))).reshape(sheet.shape)[4:7, 2:-2]
    )
    state["cloth.x"].from_numpy(sheet.x)
    return lost[inner].mean() * AREA_DENSITY / (1e-5 * 0.1 * 4.0 / sheet.spacing**4 * dt)


def momenta(sheet, state):
    x, p = state["cloth.x"].to_numpy(), sheet.mass[:, None] * state["cloth.v"].to_numpy()
    return p.sum(0), np.cross(x, p).sum(0)


def loaded(force):
    """Largest strain at any frame, of a clipped soft sheet whose nodes carry `force` [N] together."""
    section = cloth(spacing=0.005, slack=0.15, pins=corners(), strain_limit=0.1, stretch=100.0)
    extra = force / GRAVITY / 41**2

    def heavy(sheet):
        return np.where(sheet.inv_mass > 0.0, 1.0 / (sheet.mass + extra), 0.0)

    made, sheet, state = solver(section, inv_mass=heavy)
    made.settle(0.1)
    strains = []
    for _ in range(30):
        for _ in range(10):
            made.run(1e-3)
        strains.append(made.max_strain())
    return max(strains)


def dropped():
    """A sheet dropped over a box and a sphere onto the ground: (greatest depth, rms speed at last, heights at last)."""
    box = SimpleNamespace(shape="box", centre=(-0.06, 0.0, 0.03), size=(0.06, 0.08, 0.06), friction=0.3)
    ball = SimpleNamespace(shape="sphere", centre=(0.06, 0.0, 0.03), radius=0.03, friction=0.3)
    ground = SimpleNamespace(shape="plane", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), friction=0.3)
    section = cloth((0.28, 0.2), spacing=0.01, strain_limit=0.1, centre=(0.0, 0.0, 0.1))
    made, sheet, state = solver(section, solids={"box": box, "ball": ball, "ground": ground}, precision="f32")
    depth = 0.0
    for frame in range(70):
        for _ in range(10):
            made.advance(2e-3, 0.2, 1.0 if frame < 30 else 10.0)
        x = state["cloth.x"].to_numpy()
        beyond = np.abs(x - box.centre) - np.array(box.size) / 2
        in_box = np.where(beyond.max(1) > 0.0, np.linalg.norm(np.maximum(beyond, 0.0), axis=1), beyond.max(1)).min()
        gaps = (x[:, 2].min(), in_box, np.linalg.norm(x - ball.centre, axis=1).min() - ball.radius)
        depth = max(depth, sheet.thickness / 2 - min(gaps))
    return depth, math.sqrt(2.0 * made.kinetic_energy() / sheet.mass.sum()), float(x[:, 2].min()), float(x[:, 2].max())


def hung(threads=1, precision="f32"):
    """The demo's sheet after its hanging: x, speed left, sag of centre."""
    section = cloth(spacing=0.01, slack=0.15, pins=corners(), strain_limit=0.1)
    made, sheet, state = solver(section, threads=threads, precision=precision)
    made.settle(0.5)
    for _ in range(10):
        made.run(2e-3)
    return state["cloth.x"].to_numpy(), made.kinetic_energy(), made.max_strain()


def taut():
    """Sags of a strip without slack between two held ends: with its own mass, and with every mass doubled."""
    ends = tuple((i, j) for i in (0, 20) for j in range(3))
    section = cloth((0.2, 0.02), 0.01, 0.0, {"ends": SimpleNamespace(where=ends, clip=0.0)}, bending="none")
    made, sheet, state = solver(section, substep=2e-5)
    found = []
    for factor in (1.0, 2.0):
        state["cloth.inv_mass"].from_numpy(sheet.inv_mass / factor)
        for _ in range(3):
            made.settle(0.4)
        x = state["cloth.x"].to_numpy().reshape(*sheet.shape, 3)
        found.append(float(x[0, 1, 2] - x[10, 1, 2]))
    return found
