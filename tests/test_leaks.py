"""Water thrown at sheets: through ours goes nothing, through the report's something; both are counted."""

import numpy as np
import pytest

from sim.studies.leaks import COLUMNS
from tests.spawned import open_world, spawn

COARSE = ("fluid.spacing=6 mm", "cloth.spacing=1 cm")


def _throws(contact: str, thickness: float, throws: tuple, *last) -> list[dict]:
    """One World, thrown at for each (cloth, speed, dt); `below`: water under all of the sheet, clear of its hems."""
    from sim.studies import leaks

    world = open_world(leaks.SCENE, *leaks.overrides(contact, thickness), *COARSE)
    start, rows = world.save(), []
    for cloth, speed, dt in throws:
        world.load(start)
        leaks.place(world, cloth, speed)
        found = leaks.throw(world, speed, dt)
        water = world.state["fluid.x"].to_numpy()[: int(world.state.count[None])]
        sheet = world.state["cloth.x"].to_numpy()
        over = (np.abs(water[:, :2]) < 0.03).all(1)
        below = int((over & (water[:, 2] < sheet[:, 2].min())).sum())
        counted = 1e-15 * int(world.state["scene.population.time"][0])
        told = {"cloth": cloth, "speed": speed, "dt": dt, "below": below, "counted": counted}
        rows.append(found | told)
    for act in last:
        world.load(start)
        rows.append(act(world))
    return rows


def _ours() -> dict:
    """Slow and fast, by small and large steps, at each kind of sheet; and a pinch."""
    slow_and_fast = ((0.3, 5e-3), (10.0, 1e-3), (100.0, 1e-4))
    throws = tuple((cloth, *s) for cloth in ("flat", "folded", "moving") for s in slow_and_fast)
    acts = (_pinch, lambda world: _pinch(world, 5e-5), _ways, _slivers)
    *rows, pinch, short, asked, slivers = _throws("ccd", 5e-4, throws, *acts)
    return {"throws": rows, "pinch": pinch, "short": short, "asked": asked, "slivers": slivers}


def _ways(world) -> list[dict]:
    """See _asked: all water and some of it, fast and slow, with the sheet and against it, and far to all sides."""
    few = {"cloth": "flat", "clump": 0.1}
    slow, start, told = few | {"speed": 6.0}, world.save(), []
    for way in ({}, {"drift": 0.01}, few, slow, slow | {"drift": 0.004}, slow | {"fan": 0.1}, slow | {"meet": 0.001}):
        world.load(start)
        told.append(_asked(world, **way))
    return told


def _asked(world, cloth: str = "folded", speed=60.0, clump=1.0, fan=0.0, drift=0.0, meet=0.0) -> dict:
    """Water that goes some way, each its own, at a sheet that moves; who crossed, if only those are asked who may have,
    of the boxes that they may have met, and if all are asked of all triangles. gap, and the distance from the nearest
    of some places on each triangle. near: patches that count as near the water.

    clump: how wide the water lies; fan: how far it goes to all sides; drift: how far all goes together; meet: how far
    water and sheet go towards each other besides, each [m].
    """
    from sim.studies import leaks

    leaks.place(world, cloth, speed)
    state, contact, random = world.state, world.build.parts["contact"], np.random.default_rng(3)
    living, corners = int(state.count[None]), world.scene.sheet.triangles
    x, sheet = (state[name].to_numpy() for name in ("fluid.x", "cloth.x"))
    x[:living] *= clump
    state["fluid.x"].from_numpy(x)
    contact.sides.run(1e-3)
    contact.catch.begin()
    gap, near = contact.sides.gap.to_numpy(), contact.sheet.near.to_numpy().mean()
    shares = random.dirichlet((0.5, 0.5, 0.5), 12)
    places = np.einsum("sk,tkd->std", shares, sheet[corners]).reshape(-1, 3)
    nearest = np.array([np.linalg.norm(places - at, axis=1).min() for at in x[:living]])
    ways = 1e-3 * state["fluid.v"].to_numpy()[:living] + fan * random.normal(size=(living, 3)) * [1.0, 1.0, 0.0]
    x[:living] += random.uniform(0.0, 1.0, (living, 1)) ** 2 * ways + drift - [0.0, 0.0, meet]
    state["fluid.x"].from_numpy(x)
    waves = 1e-3 * np.sin(40.0 * sheet[:, [1]])
    state["cloth.x"].from_numpy((sheet + waves + drift + [0.0, 0.0, meet]).astype(np.float32))
    contact.catch.find()
    first, apart = _asked_of_all(contact, living, len(corners))
    crossed = (contact.catch.crossed.to_numpy()[:living], first)
    return {"crossed": crossed, "apart": apart, "gap": gap[:living], "nearest": nearest, "near": near}


def _asked_of_all(contact, living: int, triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """(living,) the first triangle that each particle passes, or -1: every triangle is asked. (2, living) whether the
    sheet as it stands is between it and another one: as the search finds, and every triangle."""
    import taichi as ti

    from sim.coupling.sides import segment_hits
    from sim.maths.ccd import EXACT, first_hit

    catch, first, apart = contact.catch, ti.field(ti.i32, shape=living), ti.field(ti.i32, shape=(2, living))

    @ti.kernel
    def ask_all():
        for i in range(living):
            other = (i + 7) % living
            apart[0, i] = contact.sides.crosses(catch.x[i], catch.x[other])
            best, first[i] = ti.cast(2.0, ti.f64), -1
            for t in range(triangles):
                a0, b0, c0 = catch.sheet.points_before(t)
                a1, b1, c1 = catch.sheet.points(t)
                time = first_hit(catch.x0[i], catch.x[i], a0, a1, b0, b1, c0, c1, EXACT)[0]
                if time < best and time <= 1.0:
                    best, first[i] = time, t
                apart[1, i] |= segment_hits(catch.x[i], catch.x[other], a1, b1, c1)

    ask_all()
    return first.to_numpy(), apart.to_numpy()


def _slivers(world) -> dict:
    """Water about a sheet with a thin triangle here and there, where that is nearest: gap, as it is found first and
    then from the triangle found before; and how far off its box is."""
    state, contact, random = world.state, world.build.parts["contact"], np.random.default_rng(4)
    sheet, living, used, at = state["cloth.x"].to_numpy(), int(state.count[None]), set(), []
    sheet += random.uniform(-0.003, 0.003, sheet.shape).astype(np.float32)
    for p, q, r in world.scene.sheet.triangles:
        if not used & {p, q, r}:
            sheet[p] = 0.6 * sheet[q] + 0.4 * sheet[r]
            used |= {p, q, r}
            at.append(p)
    state["cloth.x"].from_numpy(sheet)
    a, b, c = (sheet[world.scene.sheet.triangles[:, k]].astype(float) for k in range(3))
    longest = np.max([((p - q) ** 2).sum(1) for p, q in ((a, b), (b, c), (c, a))], 0)
    thin = (np.cross(b - a, c - a) ** 2).sum(1) < 0.9e-3 * longest**2
    gaps, boxes = ([], []), []
    for _ in range(20):
        x = random.choice(sheet[at], state["fluid.x"].shape[0]) + random.uniform(-0.003, 0.003, (1, 3))
        state["fluid.x"].from_numpy(x.astype(np.float32))
        state["fluid.triangle"].fill(-1)
        contact.sides.run(1e-3)
        first = contact.sides.gap.to_numpy()[:living]
        contact.sides.run(1e-3)
        nearest = state["fluid.triangle"].to_numpy()[:living]
        corners = sheet[world.scene.sheet.patches[nearest // 2]]
        outside = np.maximum(corners.min(1) - x[:living], x[:living] - corners.max(1)).clip(0.0)
        found = (nearest >= 0) & thin[nearest]
        for gap, told in zip((first, contact.sides.gap.to_numpy()[:living]), gaps):
            told.extend(gap[found])
        boxes.extend(np.linalg.norm(outside, axis=1)[found])
    return {"gaps": np.array(gaps), "box": np.array(boxes)}


def _pinch(world, dt: float = 1e-3) -> dict:
    """Water between the layers of a free, folded sheet that pass through each other in one step: no place is left."""
    from sim.scene.hang import folded

    sheet, state, contact = world.scene.sheet, world.state, world.build.parts["contact"]
    x = folded(sheet.uv - 0.5 * sheet.uv.max(0), 0.01)
    moves = np.array([0.3, 0.1, 0.2]) - 10.0 * x * [0.0, 0.0, 1.0]
    water = state["fluid.x"].to_numpy()
    water[:, 2] = 0.05 * (water[:, 2] - water[:, 2].mean())
    for name, values in (("inv_mass", 1.0 / sheet.mass), ("x", x), ("v", moves)):
        state[f"cloth.{name}"].from_numpy(values.astype(np.float32))
    state["fluid.x"].from_numpy(water)
    state["fluid.v"].fill(0.0)
    contact.sides.run(dt)
    contact.catch.begin()
    state["cloth.x"].from_numpy((x * [1.0, 1.0, -1.0]).astype(np.float32))
    before, counts = _momentum(world), contact.counts()
    took_back = contact.catch.run(dt)
    after, now = _momentum(world), contact.counts()
    moved = np.abs(state["cloth.x"].to_numpy() - x).max()
    counted = {name: now[name] - counts[name] for name in now}
    return {"momentum": (before, after), "took_back": took_back, "moved": moved, **counted}


def _momentum(world) -> np.ndarray:
    rows = {name: values.to_numpy().astype(float) for name, values in world.state.fields.items()}
    living = int(world.state.count[None])
    water = rows["fluid.mass"][:living, None] * rows["fluid.v"][:living]
    return water.sum(0) + (rows["cloth.v"] / rows["cloth.inv_mass"][:, None]).sum(0)


@pytest.fixture(scope="module")
def ours():
    return spawn(_ours)


def test_nothing_gets_through_at_any_speed_and_step(ours):
    throws = ours["throws"]
    assert all(row["leaks"] == 0 and not row["failure"] for row in throws)
    assert set(COLUMNS) <= set(throws[0]) | {"contact", "thickness"}
    assert all(row["below"] == 0 for row in throws if row["cloth"] == "flat")
    assert sum(row["caught"] for row in throws) > 100


def test_who_is_not_asked_has_not_crossed(ours):
    for asked in ours["asked"]:
        found, truth = asked["crossed"]
        assert np.array_equal(found, truth)
        assert 0.1 < (truth >= 0).mean() < 0.9 and asked["near"] < 0.9


def test_the_sheet_is_between_two_where_one_of_all_its_triangles_is(ours):
    for asked in ours["asked"]:
        found, truth = asked["apart"]
        assert np.array_equal(found, truth)
        assert 0.05 < truth.mean() < 0.95


def test_no_place_of_the_sheet_is_nearer_than_the_gap(ours):
    gap, nearest = ours["asked"][0]["gap"], ours["asked"][0]["nearest"]
    assert (0.999 * gap <= nearest).all()
    assert 0.05 < (gap < gap.max()).mean()


def test_of_a_sliver_only_its_box_tells_how_near_it_is(ours):
    gaps, box = ours["slivers"]["gaps"], ours["slivers"]["box"]
    assert len(box) > 20
    for gap in gaps:
        assert (gap <= 1.001 * box + 1e-6).all()


def test_a_step_that_pinches_water_is_taken_back_and_keeps_momentum(ours):
    pinch = ours["pinch"]
    before, after = pinch["momentum"]
    assert pinch["took_back"] and pinch["undone"] == 1 and pinch["leaks"] == 0 and pinch["moved"] < 1e-7
    assert np.abs(after - before).max() < 1e-5 * np.linalg.norm(before)


def test_in_a_short_step_what_is_pinched_is_tied_and_the_rest_moves(ours):
    short = ours["short"]
    before, after = short["momentum"]
    assert not short["took_back"] and short["undone"] == 0 and short["leaks"] == 0
    assert short["tied"] > 10 and short["moved"] > 1e-3
    assert np.abs(after - before).max() < 1e-5 * np.linalg.norm(before)


def test_a_step_taken_back_is_gone_in_halves_and_time_is_counted_once(ours):
    throws = ours["throws"]
    assert sum(row["undone"] for row in throws) > 0
    for row in throws:
        assert row["counted"] == pytest.approx(row["steps"] * row["dt"], rel=1e-9)


def test_the_reports_contact_leaks_where_a_step_passes_its_boxes():
    """Steps of 0.2 and of 10 thicknesses at a flat sheet, and a sheet that moves into the water."""
    slow, fast, moving = spawn(
        _throws, "plane_reflect", 5e-4, (("flat", 1.0, 1e-4), ("flat", 10.0, 5e-4), ("moving", 1.0, 1e-3))
    )
    assert slow["leaks"] == 0 and slow["caught"] > 0
    assert fast["leaks"] > 0 and fast["below"] > 0
    assert moving["leaks"] > 0


@pytest.mark.parametrize(
    "extra, line",
    [
        ("[wetting]\n", 'coupling.contact = "plane_reflect": has no water at rest on the cloth for [wetting]'),
        ("", "coupling.restitution = 0.5: plane_reflect sends all water back"),
    ],
)
def test_what_the_reports_contact_does_not_know_is_refused(extra, line, tmp_path):
    from sim.config import load
    from sim.errors import ConfigError

    path = tmp_path / "x.toml"
    wrong = "" if extra else "restitution = 0.5\n"
    path.write_text(f'schema = 1\nextends = "thrown"\n[coupling]\ncontact = "plane_reflect"\n{wrong}{extra}')
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert line in str(caught.value)


def test_the_chart_is_drawn_from_its_csv_alone(tmp_path):
    import imageio.v3 as iio

    from render.leaks import leak_chart
    from sim.studies.ablate import write_table
    from sim.studies.leaks import verdict

    fine = {"contact": "ccd", "cloth": "flat", "thickness": 5e-4, "speed": 1.0, "dt": 1e-3, "particles": 10, "steps": 4}
    fine |= {"caught": 1, "undone": 0, "tied": 0, "leaks": 0, "failure": ""}
    rows = [fine, fine | {"contact": "plane_reflect", "leaks": 7}]
    assert set(COLUMNS) == set(fine)
    write_table(tmp_path / "leaks.csv", COLUMNS, rows)
    leak_chart(tmp_path / "leaks.csv", tmp_path / "leaks.png")
    assert iio.imread(tmp_path / "leaks.png").std() > 10
    assert verdict(rows).splitlines()[0] == "ccd: 0 of 1 throws leak"
