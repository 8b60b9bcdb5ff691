"""Water thrown at sheets: through ours goes nothing, through the report's something; both are counted."""

import numpy as np
import pytest

from tests.spawned import open_world, spawn

COARSE = ("fluid.spacing=6 mm", "cloth.spacing=1 cm")


def _throws(contact: str, thickness: float, throws: tuple) -> list[dict]:
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
        rows.append(
            found | {"cloth": cloth, "speed": speed, "below": int((over & (water[:, 2] < sheet[:, 2].min())).sum())}
        )
    return rows


@pytest.fixture(scope="module")
def ours():
    """Slow and fast, by small and large steps, at each kind of sheet."""
    slow_and_fast = ((0.3, 5e-3), (10.0, 1e-3), (100.0, 1e-4))
    throws = tuple((cloth, *s) for cloth in ("flat", "folded", "moving") for s in slow_and_fast)
    return spawn(_throws, "ccd", 5e-4, (*throws, ("flat", 100.0, 5e-3)))


def test_nothing_gets_through_at_any_speed_and_step(ours):
    assert all(row["leaks"] == 0 and not row["failure"] for row in ours)
    assert all(row["below"] == 0 for row in ours if row["cloth"] == "flat")
    assert sum(row["caught"] for row in ours) > 100


def test_a_step_that_nothing_else_saves_is_taken_back(ours):
    assert ours[-1]["undone"] > 0
    assert all(row["undone"] == 0 for row in ours if row["speed"] <= 10.0 and row["cloth"] != "folded")


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
