"""Each process against its closed form: wicking flat and upright, soaking, seeping, drops."""

import math

import numpy as np
import pytest

from tests.spawned import open_world, spawn

STRIP = """
schema = 1
[run]
duration = "1 s"
fps = 10
[space]
gravity = [0.0, 0.0, {gravity}]
low = [-0.3, -0.3, -0.3]
high = [0.3, 0.3, 0.3]
[fluid]
spacing = "4 mm"
[cloth]
size = ["12 cm", "1.2 cm"]
spacing = "{spacing} mm"
normal = [{normal}]
[coupling]
[wetting]
processes = [{processes}]
"""


def _flat(path: str) -> dict:
    """Pore water over time in a strip whose first row of patches is kept full."""
    world = open_world(path)
    water, wick = world.build.parts["cloth_water"], world.build.parts["wick"]
    dt, width, cell = 0.9 * wick.max_dt().seconds, water.columns * water.spacing, water.spacing
    pores = np.zeros((water.rows, water.columns), np.int64)
    times, uptake, fronts = [], [], []
    water.begin(dt)
    for step in range(1, 14001):
        pores[0] = water.capacity
        water.pores.from_numpy(pores.ravel())
        wick.flow(dt)
        pores = water.pores.to_numpy().reshape(water.rows, water.columns)
        if step % 500 == 0:
            s = pores.mean(1) / water.capacity
            times.append(step * dt)
            uptake.append((pores[1:].sum() / water.capacity) * cell**2 / width)
            edge = np.flatnonzero(s > 0.05)[-8:]
            slope, offset = np.polyfit((edge + 0.5) * cell, s[edge], 1)
            fronts.append(-offset / slope - cell)
    return {"times": times, "uptake": uptake, "fronts": fronts, "diffusivity": wick.diffusivity, "cell": cell}


def test_wicking_along_a_flat_strip(tmp_path):
    """Uptake 0.887 phi t w sqrt(D t), front 1.616 sqrt(D t): Richards with k_r = S (Philip's similarity solution)."""
    path = tmp_path / "flat.toml"
    path.write_text(STRIP.format(gravity="0.0", spacing=1, normal="0.0, 0.0, 1.0", processes='"wick"'))
    got = spawn(_flat, str(path))
    root = np.sqrt(got["diffusivity"] * np.array(got["times"]))
    front = np.array(got["fronts"])
    late = (front > 50 * got["cell"]) & (front < 0.1)
    assert late.sum() >= 5
    exponent = np.polyfit(np.log(np.array(got["times"])[late]), np.log(np.array(got["uptake"])[late]), 1)[0]
    assert exponent == pytest.approx(0.50, abs=0.01)
    assert np.mean(np.array(got["uptake"])[late] / root[late]) == pytest.approx(0.887, rel=0.03)
    assert np.mean(front[late] / root[late]) == pytest.approx(1.616, rel=0.03)


def _upright(path: str) -> dict:
    """Saturation over height at rest, the foot kept full; then exchanges set by hand on the same sheet."""
    world = open_world(path)
    parts, state = world.build.parts, world.state
    water, wick, seep, drip = (parts[n] for n in ("cloth_water", "wick", "seep", "drip"))
    z = state["cloth.x"].to_numpy()[:, 2].reshape(world.scene.sheet.shape)
    height = 0.25 * (z[:-1, :-1] + z[1:, :-1] + z[:-1, 1:] + z[1:, 1:])
    foot = height == height.min()
    dt = 0.9 * wick.max_dt().seconds
    pores = np.full(height.shape, water.capacity // 2, np.int64)
    water.begin(dt)
    for _ in range(12000):
        pores[foot] = water.capacity
        water.pores.from_numpy(pores.ravel())
        wick.flow(dt)
        pores = water.pores.to_numpy().reshape(height.shape)
    rise = (height - height.min()).ravel()
    rest = 1.0 - rise * 9.81 * water.liquid.rest_density / water.suction
    saturation = pores.ravel() / water.capacity
    return {"saturation": saturation, "expected": rest, **_forced(world, water), "drop": drip.drop_units}


def _asked(world, part, saturation: float, pressure: float) -> tuple[np.ndarray, np.ndarray]:
    """What every patch asks of its front for pores and for film in 1 ms, if that is covered."""
    water, supply, dt = world.build.parts["cloth_water"], world.build.parts["supply"], 1e-3
    water.pores.from_numpy(np.full(water.patch_count, int(saturation * water.capacity), np.int64))
    supply.begin(dt)
    supply.cover.from_numpy(np.tile(np.array([2**24, 0], np.int64), (water.patch_count, 1)))
    water.front.from_numpy(np.full(water.node_count, pressure, np.float32))
    world.build.parts[part].ask(dt)
    return supply.for_pores.to_numpy()[:, 0], supply.for_film.to_numpy()[:, 0]


def _forced(world, water) -> dict:
    """What one covered patch asks for in 1 ms: of its pores at S = 1/2, and of seepage at S = 1 and 200 Pa."""
    water.film.from_numpy(np.full(water.patch_count, water.capacity, np.int64))
    asked = {
        "soaked": int(_asked(world, "absorb", 0.5, 0.0)[0][0]),
        "seeped": int(_asked(world, "seep", 1.0, 200.0)[1][0]),
    }
    fabric, liquid = water.fabric, water.liquid
    return {
        **asked,
        "capacity": water.capacity,
        "suction": water.suction,
        "area": water.area,
        "mu": liquid.mu,
        "rho": liquid.rest_density,
        "permeability": fabric.permeability_through,
        "thickness": fabric.thickness,
        "porosity": fabric.porosity,
    }


@pytest.fixture(scope="module")
def upright(tmp_path_factory):
    """A strip standing on its long edge."""
    path = tmp_path_factory.mktemp("strip") / "upright.toml"
    text = STRIP.format(
        gravity="-9.81", spacing=4, normal="0.0, 1.0, 0.0", processes='"absorb", "seep", "wick", "drip"'
    )
    path.write_text(text.replace('["12 cm", "1.2 cm"]', '["2 cm", "12 cm"]'))
    return spawn(_upright, str(path))


def test_water_at_rest_in_an_upright_strip(upright):
    """Suction holds weight: S = 1 - rho g z / p_c0."""
    assert upright["expected"].min() < 0.5
    assert np.abs(upright["saturation"] - upright["expected"]).max() <= 0.03


def test_soaking_follows_its_exact_exponential(upright):
    """dS = (1 - S)(1 - exp(-dt/tau)), tau = phi t^2 mu / (2 K p_c0)."""
    u = upright
    tau = u["porosity"] * u["thickness"] ** 2 * u["mu"] / (2.0 * u["permeability"] * u["suction"])
    assert u["soaked"] / u["capacity"] == pytest.approx(0.5 * (1.0 - math.exp(-1e-3 / tau)), rel=1e-3)


def test_seepage_solves_its_quadratic(upright):
    """mu q/K + beta rho q^2 = dp/t (the sheet stands: gravity does not help)."""
    u = upright
    q = u["seeped"] * 1e-15 / (u["rho"] * u["area"] * 1e-3)
    beta = 0.143 * u["porosity"] ** -1.5 * u["permeability"] ** -0.5
    assert u["mu"] * q / u["permeability"] + beta * u["rho"] * q**2 == pytest.approx(200.0 / u["thickness"], rel=5e-3)


def test_a_drop_has_the_mass_of_tates_law(upright):
    """0.6 x 2 pi l_c gamma / g, l_c the capillary length: 76 mg of water."""
    gamma, rho = 0.07275, upright["rho"]
    expected = 0.6 * 2.0 * math.pi * math.sqrt(gamma / (rho * 9.81)) * gamma / 9.81
    assert upright["drop"] * 1e-15 == pytest.approx(expected, rel=0.01)
    assert expected == pytest.approx(75e-6, rel=0.02)


def _laid(path: str) -> dict:
    """Water poured on a cloth over a table; what every patch would then let through; a particle deep in the table."""
    from sim.scene.clearance import clearance

    world = open_world(path, quick=True)
    table = [p for p in world.scene.solids.primitives if p.solid == "table"]
    fluid, water = world.state, world.build.parts["cloth_water"]

    def rows(name):
        return fluid[name].to_numpy()[: int(fluid.count[None])]

    gaps, speeds = [], []
    while world.clock.time < 0.6:
        world.step()
        if len(rows("fluid.x")):
            gaps.append(clearance(table, rows("fluid.x")).min())
            speeds.append(np.linalg.norm(rows("fluid.v"), axis=1).max())
    centre = _patch_centres(fluid["cloth.x"].to_numpy().reshape(water.rows + 1, water.columns + 1, 3))
    far = np.linalg.norm(centre[:, :2], axis=1)
    gap = np.maximum(clearance(table, centre) - 0.5 * water.fabric.thickness, 0.0)
    film = water.film.to_numpy() * 1e-15 / (water.liquid.rest_density * water.area)
    pores, front = water.pores.to_numpy(), water.front.to_numpy()
    asked = _asked(world, "seep", 1.0, 200.0)[1] * 1e-15 / (water.liquid.rest_density * water.area)
    water.pores.from_numpy(pores)
    water.front.from_numpy(front)
    laid = far < 0.11
    x = fluid["fluid.x"].to_numpy()
    x[0] = table[0].centre + np.array([0.02, 0.02, 0.001])
    fluid["fluid.x"].from_numpy(x)
    ident, deep = rows("fluid.id")[0], []
    for _ in range(60):
        world.step()
        here = np.flatnonzero(rows("fluid.id") == ident)
        deep.append(np.linalg.norm(rows("fluid.v")[here], axis=1).max(initial=0.0))
    return {
        "gap": min(gaps),
        "fastest": max(speeds),
        "gaps": np.median(gap[laid]),
        "film": np.median(film[laid]),
        "beyond": (film + asked - gap)[laid & (asked > 0.0)].max(),
        "hung": asked[far > 0.14].min(),
        "deep": max(deep),
    }


def _patch_centres(x) -> np.ndarray:
    return 0.25 * (x[1:, 1:] + x[:-1, 1:] + x[1:, :-1] + x[:-1, :-1]).reshape(-1, 3)


def test_cloth_on_a_table_lets_nothing_through():
    """No film between cloth and table, no drop inside of it; beyond the rim, where cloth hangs, it seeps."""
    seen = spawn(_laid, "spill")
    assert seen["gaps"] < 1e-5 and seen["film"] < 1e-5
    assert seen["beyond"] < 1e-6 and seen["hung"] > 3e-6  # m of film, there and asked for, more than the gap holds
    assert seen["gap"] > 0.0 and seen["fastest"] < 4.0
    assert seen["deep"] < 5.0  # a particle put into the table comes out of it


HALVES = """
schema = 1
[run]
duration = "1 s"
fps = 10
[space]
low = [-0.1, -0.1, -0.1]
high = [0.1, 0.1, 0.1]
[fluid]
spacing = "4 mm"
  [fluid.block.under]
  low = [-0.04, -0.02, -0.012]
  high = [-0.008, 0.02, 0.0]
  [fluid.block.over]
  low = [0.008, -0.02, 0.0]
  high = [0.04, 0.02, 0.012]
[cloth]
size = ["10 cm", "6 cm"]
spacing = "5 mm"
settle = "0 s"
slack = 0.0
  [cloth.pins]
  hems = { where = "edges" }
[coupling]
[wetting]
processes = ["absorb", "seep", "wick", "drip"]
"""


def _halves(path: str) -> dict:
    """Film under all of a sheet that has water under one half and on the other: where it goes in one turn."""
    world = open_world(path)
    parts, state = world.build.parts, world.state
    water, supply = parts["cloth_water"], parts["supply"]
    world.step()
    rejoin = next(s for s in world.stages if s.name == "wetting.rejoin")
    film = np.full(water.patch_count, round(0.05e-3 * water.area * 1000.0 / 1e-15), np.int64)
    water.film.from_numpy(film)
    water.begin(1e-4)
    supply.begin(1e-4)

    def tell():
        n = int(state.count[None])
        mass, v = state["fluid.mass_units"].to_numpy()[:n], state["fluid.v"].to_numpy()[:n]
        return mass.sum(), (mass[:, None] * v).sum(0), water.momentum.to_numpy().sum(0), water.film.to_numpy()

    before = tell()
    rejoin.run(1e-4)
    after = tell()
    sheet = world.scene.sheet
    x = _patch_centres(state["cloth.x"].to_numpy().reshape(water.rows + 1, water.columns + 1, 3))[:, 0]
    inside = np.abs(sheet.x[sheet.patches].mean(1)[:, 1]) < 0.015
    return {
        "mass": int(before[0] + before[3].sum() - after[0] - after[3].sum()),
        "momentum": (after[1] + after[2] - before[1] - before[2]) / after[0],
        "under": after[3][inside & (x < -0.012) & (x > -0.036)].max(),
        "over": after[3][x > 0.0].min() / film[0],
    }


def test_film_over_water_joins_it_and_under_water_stays(tmp_path):
    path = tmp_path / "halves.toml"
    path.write_text(HALVES)
    seen = spawn(_halves, str(path))
    assert seen["mass"] == 0 and np.abs(seen["momentum"]).max() < 1e-7  # m/s: as f32 holds it
    assert seen["under"] == 0 and seen["over"] == 1.0
