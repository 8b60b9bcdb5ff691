"""Scenes of cloth that meets itself for test_folds.py, each run in a process of its own; they return plain numbers."""

import numpy as np
from spawned import open_world

PILE = ("run.duration=1.0", "run.fps=25")


def _hash_at(world, frame):
    while world.frame_index < frame:
        world.advance()
    return world.state_hash()


def pile(frames=18):
    """(crossings at each frame, largest strain, kept hash, hash after going back, counts) of a coarse pile; and
    crossings when the sheet has settled on the ground before it all."""
    from sim.studies.crossings import crossings

    world = open_world("pile", *PILE, quick=True, threads=2)
    sheet, triangles = world.scene.sheet, np.asarray(world.scene.sheet.triangles)
    world.state["cloth.x"].from_numpy((sheet.x - [0.0, 0.0, 0.095]).astype(np.float32))
    world.build.parts["cloth"].settle(0.7)
    settled = crossings(world.snapshot().cloth_x, triangles)
    world.state["cloth.x"].from_numpy(sheet.x.astype(np.float32))
    counts = world.build.parts["self_contact"].counts()
    found, strain = [], 0.0
    for frame in range(1, frames + 1):
        x = world.advance().cloth_x
        found.append(crossings(x, triangles))
        strain = max(strain, world.build.parts["cloth"].max_strain())
        if frame == 10:
            kept = world.save()
            ahead = _hash_at(world, 11)
            world.load(kept)
    world.load(kept)
    counts = {name: n - counts[name] for name, n in world.build.parts["self_contact"].counts().items()}
    return found, strain, ahead, _hash_at(world, 11), counts, settled


def pile_on_one_thread():
    """Its hash at frame 11."""
    return _hash_at(open_world("pile", *PILE, quick=True), 11)


def clap(method, frames):
    """(most kinetic energy of the last second over its peak, farthest that a node goes in it [m], crossings at last)"""
    from sim.studies.crossings import crossings

    world = open_world("handclap", f"cloth.self_contact={method}", "run.duration=8", "run.fps=10")
    places, energies = [], []
    for _ in range(frames):
        places.append(world.advance().cloth_x)
        energies.append(world.build.parts["cloth"].kinetic_energy())
    moved = np.linalg.norm(places[-1] - places[-10], axis=1).max()
    found = crossings(places[-1], np.asarray(world.scene.sheet.triangles))
    return max(energies[-10:]) / max(energies), float(moved), found


def hands():
    """Two hands of 3 N turn a towel, one draws outward: (farthest that a held node is from its hand's place, waiting
    and giving way included [m]; time on the path; largest strain; ways given [m] and pulls [N] of both)."""
    world = open_world("twist", "cloth.pins.left.path.shift=[[0, 0, 0], [-0.4, 0, 0]]", quick=True)
    clips, worst, strain = world.build.parts["clips"], 0.0, 0.0
    for _ in range(6):
        x = world.advance().cloth_x
        now, given = float(world.state["cloth.clips.time"][0]), world.state["cloth.clips.give"].to_numpy()
        for n, grip in enumerate(clips.grips):
            worst = max(worst, np.abs(x[grip.nodes] - grip.place(now) - given[n]).max())
        strain = max(strain, world.build.parts["cloth"].max_strain())
    pulls = [float(np.linalg.norm(clips.pull(n, x.astype(float)))) for n in range(2)]
    return float(worst), now, strain, [float(g[0]) for g in given[:2]], pulls


def blown(wind):
    """Acceleration [m/s^2] that a flat, free sheet across x gets from a wind, gravity off."""
    settings = (f"space.wind={wind}", "space.gravity=[0,0,0]", "cloth.normal=[1,0,0]", "cloth.pins={}")
    world = open_world("pile", *settings, quick=True, precision="f64")
    world.step()
    mass = world.scene.sheet.mass[:, None]
    return (mass * world.state["cloth.v"].to_numpy()).sum(0) / mass.sum() / world.clock.elapsed


def ways_made(kind, count=2000):
    """(count, 8, 3) ways that meet at a known moment, and as many that pass above each other."""
    rng = np.random.default_rng(3)
    x = rng.uniform(-1.0, 1.0, (count, 8, 3))
    moment, share = rng.uniform(0.0, 1.0, (count, 1)), rng.dirichlet(np.ones(3), count)
    at = x[:, :4] + moment[:, None] * (x[:, 4:] - x[:, :4])
    if kind == "point":
        gap = (share[:, :, None] * at[:, 1:]).sum(1) - at[:, 0]
        moved = [0, 4]
    else:
        s, t = share[:, :1], share[:, 1:2]
        gap = at[:, 2] + t * (at[:, 3] - at[:, 2]) - at[:, 0] - s * (at[:, 1] - at[:, 0])
        moved = [0, 1, 4, 5]
    away = x.copy()
    x[:, moved] += gap[:, None]
    away[:, moved, 2] += 3.0
    return x, away


def ways_hard(count):
    """{kind: (count, 8, 3)} for edges of 5 mm, exact in f32: nearly parallel (1e-9 to 0.1 rad) and passing, or in one
    plane; corners of a coarse lattice."""
    rng = np.random.default_rng(7)
    lattice = rng.integers(-2, 3, (count, 8, 3)) / 4.0
    flat = rng.integers(-4, 5, (count, 8, 3)) / 8.0
    flat[..., 2] = 0.25
    along = rng.normal(size=(count, 3))
    along *= 5e-3 / np.linalg.norm(along, axis=1)[:, None]
    off = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-7, -3, (count, 1))
    turned = along + 5e-3 * rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-9, -1, (count, 1))
    way = -off * rng.uniform(1.0, 3.0, (count, 1))
    before = np.stack([0.0 * off, along, off, off + turned], 1)
    after = before + np.stack([0.0 * off, 0.0 * off, way, way + 1e-6 * rng.normal(size=(count, 3))], 1)
    parallel = np.concatenate([before, after], 1) + rng.uniform(-0.3, 0.3, (count, 1, 3))
    return {kind: v.astype(np.float32) for kind, v in {"lattice": lattice, "flat": flat, "parallel": parallel}.items()}


def met(ways):
    """For each (kind, (n, 8, 3)): whether they meet, (n,) bool."""
    import taichi as ti

    from sim import runtime
    from sim.maths.ccd import EDGES, POINT, meets

    runtime.start(threads=2)

    @ti.kernel
    def answer(kind: ti.i32, x: ti.types.ndarray(), hit: ti.types.ndarray()):
        for n in range(x.shape[0]):
            p = ti.Matrix([[x[n, i, d] for d in ti.static(range(3))] for i in ti.static(range(8))])
            a = [ti.Vector([p[i, 0], p[i, 1], p[i, 2]]) for i in ti.static(range(8))]
            hit[n] = meets(kind, a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7])

    found = []
    for kind, x in ways:
        hit = np.zeros(len(x), np.int32)
        answer(EDGES if kind == "edges" else POINT, np.ascontiguousarray(x, np.float64), hit)
        found.append(hit.astype(bool))
    return found
