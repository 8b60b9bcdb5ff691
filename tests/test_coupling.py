"""Water and cloth exchange momentum and mass: what one gives the other gets, and a pool hangs on the clips."""

import numpy as np
import pytest

from tests.spawned import open_world, spawn

WEIGHTLESS = """
schema = 1
[run]
duration = "0.06 s"
fps = 50
[space]
gravity = [0.0, 0.0, 0.0]
low = [-0.3, -0.3, -0.3]
high = [0.3, 0.3, 0.3]
[fluid]
spacing = "4 mm"
"""

FREE_FLIGHT = (
    WEIGHTLESS
    + """
[fluid.block.lump]
low = [-0.016, -0.016, 0.006]
high = [0.016, 0.016, 0.03]
velocity = [0.3, 0.0, -1.0]
[cloth]
size = ["10 cm", "10 cm"]
spacing = "1 cm"
[coupling]
[wetting]
processes = ["absorb", "wick", "seep"]
"""
)

GLIDE = (
    WEIGHTLESS
    + """
[fluid.liquid]
nu = "3e-5 m^2/s"
[fluid.block.film]
low = [-0.04, -0.02, 0.0]
high = [0.0, 0.02, 0.004]
velocity = [1.0, 0.0, 0.0]
[cloth]
size = ["12 cm", "10 cm"]
spacing = "1 cm"
[coupling]
friction = 2.0
"""
)

TAUT = """
schema = 1
[run]
duration = "1 s"
fps = 10
[space]
low = [-0.3, -0.3, -0.3]
high = [0.3, 0.3, 0.3]
[fluid]
spacing = "4 mm"
[cloth]
size = ["20 cm", "6 cm"]
spacing = "1 cm"
settle = "6 s"
[cloth.xpbd]
substep_max = "40 us"
[cloth.pins]
left = { where = [[0, 0], [0, 1], [0, 2], [0, 3], [0, 4], [0, 5], [0, 6]], clip = 0.0 }
right = { where = [[20, 0], [20, 1], [20, 2], [20, 3], [20, 4], [20, 5], [20, 6]], clip = 0.0 }
[coupling]
[wetting]
"""


def _momentum(world) -> np.ndarray:
    """(3,) of water and free cloth [kg m/s]: held water moves with the nodes that carry it."""
    total = np.zeros(3)
    living = int(world.state.count[None])
    for group, rows in (("fluid", slice(living)), ("cloth", world.state["cloth.inv_mass"].to_numpy() > 0.0)):
        m = world.state[f"{group}.mass"].to_numpy()[rows].astype(float)
        total += (m[:, None] * world.state[f"{group}.v"].to_numpy()[rows].astype(float)).sum(0)
    return total


def _free_flight(path: str, *overrides: str) -> dict:
    world = open_world(path, *overrides)
    seen = [_momentum(world)]
    for _ in range(world.frame_count):
        world.advance()
        seen.append(_momentum(world))
    masses = world.masses()
    return {
        "momentum": np.array(seen),
        "held": masses.held,
        "error": masses.error(),
        "bits": world.state_hash(),
        **world.build.parts["contact"].counts(),
    }


@pytest.fixture(scope="module")
def free_flight(tmp_path_factory):
    """A lump of water thrown at a free sheet, without gravity; the sheet drinks."""
    path = tmp_path_factory.mktemp("flight") / "flight.toml"
    path.write_text(FREE_FLIGHT)
    return spawn(_free_flight, str(path)) | {"path": str(path)}


def test_momentum_of_a_free_sheet_and_water_is_kept_to_rounding(free_flight):
    p = free_flight["momentum"]
    assert np.linalg.norm(p[0]) > 0.02
    assert np.abs(p - p[0]).max() <= 2e-5 * np.linalg.norm(p[0])


def test_the_flying_lump_wets_the_sheet_and_loses_no_gram(free_flight):
    assert free_flight["held"] > 0
    assert free_flight["error"] == 0.0
    assert free_flight["leaks"] == 0


def test_cells_and_a_refitted_tree_give_the_same_bits(free_flight):
    assert spawn(_free_flight, free_flight["path"], 'coupling.search="lbvh"')["bits"] == free_flight["bits"]


def _pool() -> dict:
    from sim.studies.meeting.pool import CASE

    return CASE.measure(open_world(CASE.scene, *CASE.quick[0].overrides))


@pytest.fixture(scope="module")
def pool():
    """80 ml at rest in a sheet that lets nothing through, as the quick chart has it."""
    return spawn(_pool)


def test_the_clips_carry_cloth_and_pool(pool):
    assert pool["on_cloth"] > 0.95
    assert abs(pool["pins"]) < 0.01


def test_the_pool_presses_as_deep_as_it_is(pool):
    assert pool["error"] < 0.05


def test_nothing_leaks_and_the_last_step_hardly_acts(pool):
    assert pool["leaks"] == 0
    assert pool["caught"] <= 1e-4


def test_the_pool_comes_to_rest(pool):
    assert pool["speed"] < 0.05


def _glide(path: str) -> dict:
    """Water that glides along a sheet that is held, in steps of two lengths, and along one that is free; and one that
    goes round a hem."""
    world, told = open_world(path), []
    start, living, sheet = world.save(), int(world.state.count[None]), world.scene.sheet
    for free, dt in ((False, 5e-4), (False, 4e-3), (True, 1e-3)):
        world.load(start)
        world.state["cloth.inv_mass"].from_numpy((free / sheet.mass).astype(np.float32))
        before = _momentum(world)
        for _ in range(round(0.02 / dt)):
            world.go(dt)
        v = world.state["fluid.v"].to_numpy()[:living]
        told.append({"v": v, "momentum": (before, _momentum(world))})
    world.load(start)
    return {"glides": told, "hem": _round_a_hem(world)}


def _round_a_hem(world) -> np.ndarray:
    """Velocity of water that leaves a held sheet over a hem, and comes back lower, all in one step."""
    state, contact, dt, dx = world.state, world.build.parts["contact"], 2e-3, 0.004
    living = int(state.count[None])
    x, v, pull = (np.zeros((*state["fluid.x"].shape, 3), np.float32) for _ in range(3))
    x[:living] = [0.0599, 0.0, 0.5 * dx]
    x[:living, 1] = np.linspace(-0.03, 0.03, living)
    v[:living], pull[:living] = [1.0, 0.0, -1.2], [-1500.0, 0.0, 0.0]
    for name, values in (("x", x), ("v", v), ("expected_pull", pull)):
        state[f"fluid.{name}"].from_numpy(values)
    state["fluid.triangle"].fill(-1)
    state["cloth.inv_mass"].fill(0.0)
    contact.sides.run(dt)
    contact.layer.begin(dt)
    assert contact.layer.count[None] == living
    world.build.parts["cloth"].advance(dt, 0.0, 0.0)
    contact.layer.end(dt)
    return state["fluid.v"].to_numpy()[:living]


@pytest.fixture(scope="module")
def glide(tmp_path_factory):
    """A film on a flat sheet, without gravity."""
    path = tmp_path_factory.mktemp("glide") / "glide.toml"
    path.write_text(GLIDE)
    return spawn(_glide, str(path))


def test_who_leaves_over_a_hem_is_not_sent_back(glide):
    assert np.abs(glide["hem"][:, 2] + 1.2).max() < 0.05


def test_a_film_is_slowed_as_its_drag_says_in_steps_of_any_length(glide):
    """dv/dt = -(a + b v) v, a = 3 nu/d^2, b = friction/(2 d): v = v0 e/(1 + (b/a) v0 (1 - e)), e = exp(-a t)."""
    *held, free = glide["glides"]
    a, b = 3.0 * 3e-5 / 0.004**2, 2.0 / (2.0 * 0.004)
    left = np.exp(-0.02 * a)
    for row in held:
        assert row["v"][:, 0] == pytest.approx(left / (1.0 + b / a * (1.0 - left)), rel=1e-4)
        assert np.abs(row["v"][:, 1:]).max() < 1e-6
    before, after = free["momentum"]
    assert 0.3 < free["v"][:, 0].mean() < 0.9
    assert np.abs(after - before).max() < 1e-5 * np.linalg.norm(before)


def _taut(path: str) -> dict:
    world = open_world(path)
    cloth, sag = world.build.parts["cloth"], {}
    fabric = world.config.cloth.fabric
    shape = world.scene.sheet.shape
    for state in ("dry", "wet"):
        if state == "wet":
            water = world.build.parts["cloth_water"]
            water.pores.from_numpy(np.full(water.patch_count, water.capacity, np.int64))
            water.settle(1e-3)
        cloth.settle(20.0)
        sag[state] = -world.state["cloth.x"].to_numpy()[:, 2].reshape(shape)[shape[0] // 2].mean()
    held = fabric.porosity * fabric.thickness * world.config.fluid.liquid.rest_density
    return {"sag": sag, "dry": fabric.area_density, "wet": fabric.area_density + held, "stretch": fabric.stretch}


def test_a_taut_sheet_hangs_lower_wet_than_dry(tmp_path):
    """Shallow elastic strip, s^3 = 3 rho_A g L^4 / (64 Y): arc strain (8/3)(s/L)^2 against tension rho_A g L^2/(8 s).

    In substeps of 40 us: at 100 us the dry sheet, being light, sags 12 % too far.
    """
    path = tmp_path / "taut.toml"
    path.write_text(TAUT)
    got = spawn(_taut, str(path))
    for state in ("dry", "wet"):
        expected = (3.0 * got[state] * 9.81 * 0.2**4 / (64.0 * got["stretch"])) ** (1.0 / 3.0)
        assert got["sag"][state] == pytest.approx(expected, rel=0.1), state
    assert got["sag"]["wet"] > 1.2 * got["sag"]["dry"]


def test_depth_is_the_mass_above_and_the_level_that_of_the_volume():
    """A sheet that slopes 1:2 under water with a level surface: 4 mm at one side, 24 mm at the other."""
    from sim.studies.meeting.load import depth_by_mass, level, under

    u, v = np.meshgrid(np.linspace(0.0, 0.04, 5), np.linspace(0.0, 0.04, 5), indexing="ij")
    x = np.stack([u, v, 0.5 * u], -1).reshape(-1, 3)
    first = (5 * np.arange(4)[:, None] + np.arange(4)).reshape(-1, 1)
    triangles = np.stack([first + [0, 5, 6], first + [0, 6, 1]], 1).reshape(-1, 3)
    dx, axis = 5e-4, np.arange(0.25e-3, 0.04, 5e-4)
    water = np.stack(np.meshgrid(axis, axis, np.arange(0.25e-3, 0.024, 5e-4), indexing="ij"), -1).reshape(-1, 3)
    water = water[water[:, 2] > 0.5 * water[:, 0]]
    corners, shares = under(x, triangles, water)
    assert np.abs((x[corners, :2] * shares[:, :, None]).sum(1) - water[:, :2]).max() < 1e-12
    mass = np.full(len(water), 1000.0 * dx**3)
    depth = depth_by_mass(x, triangles, water, mass, 1000.0).reshape(5, 5)
    assert depth[1:4, 1:4] == pytest.approx((0.024 - 0.5 * u)[1:4, 1:4], rel=0.02)
    low = level(x, triangles, 0.25 * 0.04**2 * 0.02)
    assert low == pytest.approx(0.02 * np.sqrt(0.5), rel=0.05)
