"""Solids of every shape that stand still, as water meets them; a scene runs once, in its own process."""

from types import SimpleNamespace

import numpy as np
import pytest

from sim.errors import ConfigError
from sim.scene.mesh import distance_grid, read_mesh
from tests.spawned import open_world, spawn

RING, TUBE = 0.016, 0.008
VOLUMES = {
    "ring": 2.0 * np.pi**2 * RING * TUBE**2,
    "bar": np.pi * 0.009**2 * 0.032,
    "ball": 4.0 / 3.0 * np.pi * 0.01**3,
}

SUNK = """
schema = 1
[run]
duration = "0.4 s"
fps = 20
[space]
low = [-0.1, -0.1, -0.05]
high = [0.1, 0.1, 0.1]
[fluid]
spacing = "4 mm"
[fluid.block.water]
low = [-0.06, -0.032, 0.0]
high = [0.06, 0.032, 0.06]
[solid.tank]
shape = "basin"
size = ["12 cm", "6.4 cm", "9 cm"]
[solid.ring]
shape = "mesh"
file = "sunk.obj"
scale = 0.001
centre = [0.028, 0.0, 0.03]
[solid.bar]
shape = "cylinder"
centre = [-0.035, 0.0, 0.03]
radius = "9 mm"
length = "32 mm"
axis = [0.0, 1.0, 0.0]
[solid.ball]
shape = "sphere"
centre = [-0.008, 0.012, 0.03]
radius = "1 cm"
[solid.lid]
shape = "box"
centre = [0.0, 0.0, 0.2]
size = [0.04, 0.02, 0.01]
turn = { axis = [1.0, 1.0, 0.0], angle = "50 deg" }
"""


def torus(rows: int = 32, around: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Corners [mm] and triangles, outwards."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(rows), np.arange(around), indexing="ij"))
    u, v = 2.0 * np.pi * i / rows, 2.0 * np.pi * j / around
    reach = RING + TUBE * np.cos(v)
    x = 1e3 * np.stack([reach * np.cos(u), reach * np.sin(u), TUBE * np.sin(v)], 1)
    a, b = i * around + j, (i + 1) % rows * around + j
    c, d = (i + 1) % rows * around + (j + 1) % around, i * around + (j + 1) % around
    return x, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def write_obj(path, x, triangles) -> None:
    lines = [f"v {a:.9g} {b:.9g} {c:.9g}" for a, b, c in x] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    path.write_text("\n".join(lines) + "\n")


def mesh_table(path, **more) -> SimpleNamespace:
    return SimpleNamespace(**{"file": path.name, "found": str(path), "scale": 1e-3, **more})


def test_distances_to_a_mesh_are_those_of_what_it_is_a_mesh_of(tmp_path):
    write_obj(tmp_path / "ring.obj", *torus(96, 48))
    x, triangles = read_mesh("ring", mesh_table(tmp_path / "ring.obj"))
    grid = distance_grid("ring", x, triangles, 0.004)
    at = grid.low + grid.cell * np.stack(np.indices(grid.distance.shape), -1)
    true = np.hypot(np.hypot(at[..., 0], at[..., 1]) - RING, at[..., 2]) - TUBE
    assert np.abs(grid.distance - np.clip(true, -0.01, 0.01)).max() < 2e-4
    assert ((grid.distance < 0.0) == (true < 0.0))[np.abs(true) > 1e-4].all()


def test_a_mesh_turned_inside_out_is_turned_back(tmp_path):
    x, triangles = torus()
    write_obj(tmp_path / "ring.obj", x, triangles[:, ::-1])
    x, triangles = read_mesh("ring", mesh_table(tmp_path / "ring.obj"))
    a, b, c = x[triangles].transpose(1, 0, 2)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(VOLUMES["ring"], rel=0.05)


@pytest.mark.parametrize(
    "kept, words", [(slice(3, None), "open: 9 edges have not two triangles"), (slice(0), "no tri")]
)
def test_a_mesh_that_holds_no_water_out_is_refused(tmp_path, kept, words):
    x, triangles = torus()
    write_obj(tmp_path / "ring.obj", x, triangles[kept])
    with pytest.raises(ConfigError, match=rf'solid\.ring\.file = "ring\.obj": .*{words}'):
        read_mesh("ring", mesh_table(tmp_path / "ring.obj"))


def test_a_mesh_follows_its_scene_into_the_run(scene_file, tmp_path):
    from sim import config, run

    path = scene_file(SUNK)
    with pytest.raises(ConfigError, match='solid.ring.file = "sunk.obj": no such file'):
        config.load(path)
    write_obj(path.parent / "sunk.obj", *torus())
    conf = config.load(path)
    folder = run._prepare(conf, run.Plan(tmp_path / "run"))
    (path.parent / "sunk.obj").unlink()
    again = config.load(folder.config)
    assert config.differences(again, conf) == []
    (folder.path / "meshes" / "ring.obj").write_text("v 0 0 0\n")
    with pytest.raises(ConfigError, match="is not the mesh that this scene was resolved with"):
        config.load(folder.config)


def _sunk(path: str) -> dict:
    from sim.scene.clearance import clearance
    from sim.studies.water.gauge import Gauge

    world = open_world(path)
    gauge, dx = Gauge(world), world.config.fluid.spacing
    solids = [p for p in world.scene.solids.primitives if p.solid in VOLUMES]
    start = clearance(world.scene.solids.primitives, world.scene.water.x)
    lifts, whole = [], []
    while world.clock.time < 0.4 - 1e-9:
        before = world.clock.time
        world.step()
        if world.clock.time > 0.2:
            x, force = gauge.read(world.clock.time - before)
            gap = np.array([clearance([p], x) for p in solids])
            near = (gap < 1.2 * dx) & (np.arange(len(solids))[:, None] == gap.argmin(0))
            lifts.append((near * force[:, 2]).sum(1))
            whole.append(force[:, 2].sum())
    return {
        "start": start.min() / dx,
        "gap": gap.min() / dx,
        "lifts": dict(zip([p.solid for p in solids], np.mean(lifts, 0))),
        "weight": -np.mean(whole) / (9.81 * len(x) * world.scene.water.units * 1e-15),
        "distances": _distances(world),
    }


def _distances(world) -> dict:
    """Of random points round every solid: the kernel's distance, NumPy's, how far the kernel's step along its normal
    leads, and how far away the kernel takes the point to be at least."""
    import taichi as ti

    from sim.bodies import Bodies
    from sim.scene.clearance import clearance

    bodies, primitives = Bodies.of(world.build), world.scene.solids.primitives
    points = ti.Vector.field(3, float, shape=400)
    out = ti.field(float, shape=(len(primitives), 400, 3))

    @ti.kernel
    def measure(step: float):
        for s, k in ti.ndrange(len(primitives), 400):
            nd = bodies.distance(s, points[k])
            out[s, k, 0] = nd[3]
            out[s, k, 1] = bodies.distance(s, points[k] + step * nd.xyz)[3] - nd[3]
            out[s, k, 2] = bodies.beside(s, points[k] - bodies.centre[s])

    found = {}
    for s, p in enumerate(primitives):
        reach = np.random.default_rng(s).uniform(-1.0, 1.0, (400, 3)) * (p.half + 0.006)
        x = p.centre + reach @ p.turn.T
        points.from_numpy(x.astype(np.float32))
        measure(1e-4)
        d = out.to_numpy()[s]
        found[p.solid] = (d[:, 0], clearance([p], x), d[:, 1] / 1e-4, d[:, 2])
    return found


@pytest.fixture(scope="module")
def sunk(tmp_path_factory):
    """A ring (a mesh), a bar and a ball under water at rest, 5,800 particles."""
    folder = tmp_path_factory.mktemp("sunk")
    write_obj(folder / "sunk.obj", *torus())
    (folder / "scene.toml").write_text(SUNK)
    return spawn(_sunk, str(folder / "scene.toml"))


@pytest.mark.parametrize("name", sorted(VOLUMES))
def test_what_is_under_water_is_lifted_by_the_weight_of_as_much_water(sunk, name):
    """Two to three particles a radius."""
    assert sunk["lifts"][name] == pytest.approx(9810.0 * VOLUMES[name], rel=0.1)


def test_the_walls_carry_all_of_the_water(sunk):
    assert sunk["weight"] == pytest.approx(1.0, abs=0.02)


def test_water_starts_and_stays_outside_of_solids(sunk):
    assert sunk["start"] > 0.4
    assert sunk["gap"] > 0.1


@pytest.mark.parametrize("name", ["tank", "ring", "bar", "ball", "lid"])
def test_kernels_and_numpy_agree_on_distances(sunk, name):
    kernel, numpy, along, least = sunk["distances"][name]
    near = np.abs(numpy) < 0.006
    assert near.sum() > 50
    off = 0.0022 if name == "ring" else 1e-6
    assert np.abs(kernel - numpy)[near].max() < off
    assert np.median(along[near]) == pytest.approx(1.0, abs=0.05)
    assert (least < numpy + off).all() and least.max() > 0.003


def _jet(path: str) -> dict:
    from sim.studies.water import jet

    return jet.measure(open_world(path, "run.duration=0.12", "fluid.spacing=0.0028"))


def test_a_wall_takes_the_momentum_of_a_jet():
    """Four spacings wide; what rebounds it takes twice."""
    seen = spawn(_jet, "jet")
    assert seen["error"] == pytest.approx(0.0, abs=0.1)
    assert abs(seen["rebound"]) < 0.1


def _box(path: str) -> dict:
    from sim.studies.water import dam_break_box

    return dam_break_box.measure(open_world(path, "fluid.spacing=0.05"))


def test_a_dam_breaks_against_a_box():
    """Coarse: three spacings to the box's height, so water has to stand 7.5 cm deep to have arrived."""
    seen = spawn(_box, "dam_break_box")
    assert 0.0 < seen["first"] < 0.5
    assert 0.0 < seen["second"] < 0.4
    assert abs(seen["third"]) < 0.4
    assert abs(seen["rise"]) < 0.2
    assert abs(seen["peak"]) < 1.0
