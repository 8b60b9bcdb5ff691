"""One small sheet a solver, in a process of its own, for test_cloth_solvers.py: every question is put to the same one.

Held nodes are those of inverse mass 0, a row that may change between steps: so one compiled solver answers them all.
"""

from types import SimpleNamespace

import cloth_scenes
import numpy as np

SHAPE, SPACING = (9, 8), 0.02
EXPLICIT = {"symplectic_euler": ("isometric", 1.3e-4), "explicit_euler": ("isometric", 4.5e-4)}
"""Solver: bending and retardation time."""
FABRIC = SimpleNamespace(area_density=0.15, thickness=4e-4, stretch=100.0, bending=4e-3)
"""So soft and so stiff that its fastest swing is as much one of bending as of stretching."""
LIMIT = 0.1


def section(bending="none"):
    sides = tuple(SPACING * (n - 1) for n in SHAPE)
    fabric = {"fabric": FABRIC} if bending == "isometric" else {}
    given = dict(size=sides, spacing=SPACING, bending=bending, slack=0.0, strain_limit=LIMIT)
    return cloth_scenes.cloth(**given, **fabric)


def solver(name, bending="none", threads=1, **params):
    """(solver, sheet, state): free in every node, weightless, with no limit of the step kept."""
    from sim import registry, runtime
    from sim.scene.cloth import build_sheet
    from sim.scene.solids import build_solids
    from sim.stage import Build
    from sim.state import ROWS, State

    if not runtime.running():
        runtime.start(threads=threads, precision="f64")
    registry.discover()
    cls, cloth = registry.method("cloth.solver", name), section(bending)
    sheet = build_sheet(cloth)
    state = State([ROWS[row] for row in cls.rows], {"cloth": len(sheet.x)})
    for row, value in (("x", sheet.x), ("mass", sheet.mass), ("inv_mass", 1.0 / sheet.mass)):
        state[f"cloth.{row}"].from_numpy(value)
    config = SimpleNamespace(cloth=cloth, space=SimpleNamespace(gravity=(0.0, 0.0, 0.0)), run=None)
    config.run = SimpleNamespace(dt_limits=False)
    build = Build(config, SimpleNamespace(sheet=sheet, solids=build_solids({})), state)
    return cls(build, cls.Params(**{"damping": 0.0, **params})), sheet, state


def run(made, sheet, state, h, count, x=None, v=None, held=None):
    """count substeps of h from places x and velocities v, nodes `held` at rest; places after it."""
    weights = 1.0 / sheet.mass
    if held is not None:
        weights = np.where(held, 0.0, weights)
    state["cloth.inv_mass"].from_numpy(weights)
    state["cloth.x"].from_numpy(sheet.x if x is None else x)
    state["cloth.v"].from_numpy(np.zeros_like(sheet.x) if v is None else v)
    made.params = made.params.model_copy(update={"substep_max": h})
    made.advance(count * h, 0.0, 0.0)
    return state["cloth.x"].to_numpy()


def growth(made, sheet, state, h):
    """Elastic energy after 1,500 substeps, over that after a start at random 1e-8 m from rest."""
    from sim.cloth.spectrum import stiffness_of

    times = stiffness_of(sheet)
    u = 1e-8 * np.random.default_rng(1).standard_normal(sheet.x.shape)
    after = run(made, sheet, state, h, 1500, x=sheet.x + u) - sheet.x
    return float((after * times(after)).sum() / (u * times(u)).sum())


def bound(made):
    """The longest stable substep of springs and bending alone: these starts are too small for a strain limit [s]."""
    return made.bound(made.params.retardation, made.frequency).seconds


def edge(made, sheet, state):
    """The longest stable substep, measured between 0.8 and 1.2 of the limit, over the limit."""
    low, high = 0.8, 1.2
    for _ in range(6):
        middle = 0.5 * (low + high)
        calm = growth(made, sheet, state, middle * bound(made)) < 1e3
        low, high = (middle, high) if calm else (low, middle)
    return 0.5 * (low + high)


def errors(made, sheet, state, halvings=3):
    """|x - exact| of one node on springs, all others held, after a third of its period in steps h, h/2, h/4."""
    from sim.cloth.spectrum import stiffness_of

    node = 4 * SHAPE[1] + 3
    unit = np.zeros_like(sheet.x)
    unit[node, 0] = 1.0
    stiffness = float((unit * stiffness_of(sheet)(unit)).sum())
    omega = np.sqrt(stiffness / sheet.mass[node])
    tau = getattr(made.params, "retardation", 0.0)
    zeta = 0.5 * tau * omega
    end, start = 2.0 / omega, 1e-6
    swing = omega * np.sqrt(1.0 - zeta**2)
    exact = start * np.exp(-zeta * omega * end) * (np.cos(swing * end) + zeta * omega / swing * np.sin(swing * end))
    held = np.arange(len(sheet.x)) != node
    found = []
    for k in range(halvings):
        count = 400 * 2**k
        x = run(made, sheet, state, end / count, count, x=sheet.x + start * unit, held=held)
        found.append(abs(x[node, 0] - sheet.x[node, 0] - exact) / start)
    return found


def drift(made, sheet, state, h):
    """Changes of linear and angular momentum of a tumbling, crumpling sheet, over what they were."""
    rng = np.random.default_rng(2)
    v = 0.05 * rng.standard_normal(sheet.x.shape) + np.cross([3.0, 1.0, 2.0], sheet.x) + [1.0, -0.5, 0.3]
    before = (sheet.mass[:, None] * v).sum(0), np.cross(sheet.x, sheet.mass[:, None] * v).sum(0)
    run(made, sheet, state, h, 50, v=v)
    after = cloth_scenes.momenta(sheet, state)
    return [float(np.abs(b - a).max() / np.abs(a).max()) for a, b in zip(before, after)]


def loaded(made, sheet, state, h, count, gravity):
    """Largest strain at any of 20 looks, `count` substeps apart, of the sheet held by two corners; 0.15 if it may."""
    corners, x, v, strains = np.isin(np.arange(len(sheet.x)), (0, SHAPE[1] - 1)), None, None, []
    made.gravity = (gravity, 0.0, 0.0)
    for _ in range(20):
        x = run(made, sheet, state, h, count, x=x, v=v, held=corners)
        v = state["cloth.v"].to_numpy()
        strains.append(made.max_strain())
    made.gravity = (0.0, 0.0, 0.0)
    return max(strains)


def explicit(name, bending, tau):
    """What is asked of an explicit solver."""
    made, sheet, state = solver(name, bending, retardation=tau)
    limit = made.limit().seconds
    found = {
        "fall": fallen(made, sheet, state),
        "growth": [growth(made, sheet, state, f * bound(made)) for f in (0.9, 1.1)],
        "edge": edge(made, sheet, state),
        "errors": errors(made, sheet, state),
        "drift": drift(made, sheet, state, 0.5 * limit),
        "strain": loaded(made, sheet, state, 0.9 * limit, 25, 100.0),
    }
    made.longest = 1.1 * limit
    found["words"] = [suspect.words for suspect in made.suspects()]
    if name == "explicit_euler":
        made.params = made.params.model_copy(update={"retardation": 0.0})
        made.retardation[None] = 0.0
        found["undamped"] = [growth(made, sheet, state, f * 2.0 / made.frequency) for f in (0.02, 0.1, 0.5, 0.9)]
        found["words"] += [suspect.words for suspect in made.suspects()]
    return found


def steady(name, **params):
    """What is asked of a solver that holds at every step."""
    from sim.cloth.spectrum import top_frequency

    made, sheet, state = solver(name, **params)
    far = 200.0 / top_frequency(sheet)
    held = np.arange(len(sheet.x)) < SHAPE[1]
    made.gravity = (0.0, 0.0, -9.81)
    x = run(made, sheet, state, far, 100, held=held)
    speed = float(np.abs(state["cloth.v"].to_numpy()).max())
    made.gravity = (0.0, 0.0, 0.0)
    length = float(np.linalg.norm(np.diff(x.reshape(*SHAPE, 3), axis=0), axis=-1).max()) / SPACING
    found = {"speed": speed, "length": length, "errors": errors(made, sheet, state)}
    found["strain"] = loaded(made, sheet, state, 2e-4, 10, 20 * 100.0)  # a stretch 20 times FABRIC's
    return found | {"drift": drift(made, sheet, state, 0.01 * far)}


def fall(name, bending="none", tau=None, threads=1):
    """Places of a sheet held by two corners, after 20 ms."""
    damped = {} if tau is None else {"retardation": tau}
    return fallen(*solver(name, bending, threads, **damped))


def fallen(made, sheet, state):
    made.gravity = (0.0, 0.0, -9.81)
    held = np.isin(np.arange(len(sheet.x)), (0, SHAPE[1] - 1))
    x = run(made, sheet, state, 5e-5, 400, held=held)
    made.gravity = (0.0, 0.0, 0.0)
    return x


def two_boards(name):
    """The same fall with the nodes where they are, and in rows wider apart and longer."""
    from sim.cloth import board, xpbd

    class Wider(board.Board):
        def __init__(self, shape):
            super().__init__((shape[0] + 3, shape[1] + 20))
            self.ni, self.nj = shape

    found = [fall(name)]
    xpbd.Board = Wider
    return [*found, fall(name)]
