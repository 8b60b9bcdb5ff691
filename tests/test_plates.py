"""Flow between plates that hold the water, against its series: Morris, Fox & Zhu 1997."""

import numpy as np
import pytest

from sim.config import load
from sim.errors import ConfigError
from sim.studies.water import couette, poiseuille
from tests.spawned import open_world, spawn

NU, GAP = 1e-6, 1e-3


def test_the_series_are_those_of_the_paper():
    """Two numbers of each, worked out apart from this code: m/s at y [m], t [s]."""
    y = np.array([2e-5, 5e-4])
    assert poiseuille.poiseuille(y, 0.0225, 1e-4, NU, GAP) == pytest.approx([3.1901461e-7, 2.23273751e-6], rel=1e-6)
    assert poiseuille.couette(y, 0.045, 1.25e-5, NU, GAP) == pytest.approx([5.17948467e-9, 1.19475164e-6], rel=1e-6)


def _run(case, times: tuple[float, ...]) -> dict:
    point = case.quick[0]
    world = open_world(case.scene, *point.overrides, precision=point.precision)
    figures = case.measure(world, times)
    v = world.state["fluid.v"].to_numpy()[: world.state.count[None]]
    return {**figures, "across": np.abs(v[:, 1:]).max() / v[:, 0].max(), "count": len(v)}


@pytest.mark.parametrize("case", [couette.CASE, poiseuille.CASE], ids=lambda c: c.name)
def test_flow_between_plates_starts_as_its_series_says(case):
    figures = spawn(_run, case, (0.045, 0.1125))
    assert figures["error"] < 0.02
    assert figures["across"] < 1e-6
    assert figures["count"] == 20 * 6 * 6


WRONG = {
    'solid.lid={no_slip=false, slide=["1 mm/s", 0.0, 0.0]}': "solid.lid: slide needs no_slip = true",
    "fluid.terms=[]": "solid.floor.no_slip = true: needs a viscosity among fluid.terms",
}


@pytest.mark.parametrize("setting, words", WRONG.items())
def test_what_a_wall_cannot_do_is_refused(setting, words):
    with pytest.raises(ConfigError) as error:
        load("poiseuille", [setting])
    assert words in str(error.value) and "\n" not in str(error.value)
