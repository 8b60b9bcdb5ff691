"""Cloth solvers: the step each can take, on both sides of it; their order; momentum; bending; what is refused."""

import numpy as np
import pytest
import solver_scenes as scenes
from spawned import spawn

from sim import config
from sim.cloth import spectrum
from sim.cloth.explicit import ExplicitEuler, SymplecticEuler
from sim.errors import ConfigError
from sim.scene.cloth import build_sheet
from sim.studies.case import run_point
from sim.studies.cloth import cantilever, catenary


def of_shape(ni, nj, **more):
    from cloth_scenes import cloth

    return build_sheet(cloth(size=(0.02 * (ni - 1), 0.02 * (nj - 1)), spacing=0.02, **more))


def dense(sheet, springs=True):
    """sqrt(lambda_max(M^-1/2 K M^-1/2)) by a matrix."""
    times, root, n = spectrum.stiffness_of(sheet, springs), np.sqrt(sheet.inv_mass)[:, None], len(sheet.x)
    columns = np.eye(3 * n).reshape(3 * n, n, 3)
    matrix = np.array([(root * times(root * u)).ravel() for u in columns])
    assert np.allclose(matrix, matrix.T)
    return np.sqrt(np.linalg.eigvalsh(matrix)[-1])


@pytest.mark.parametrize("bending", ["none", "flexion", "isometric"])
def test_the_fastest_swing_is_the_sheets_own(bending):
    free = of_shape(9, 8, bending=bending)
    assert spectrum.top_frequency(free) == pytest.approx(dense(free), rel=1e-6)
    grid = 2.0 * np.sqrt(9 / 8 * 2000.0 / (0.15 * 0.02**2))
    assert 0.98 * grid < spectrum.top_frequency(free) < 1.1 * grid  # free edges with lumped masses raise it a little


def test_held_nodes_do_not_swing_and_a_large_sheet_is_looked_at_in_part():
    from types import SimpleNamespace

    held = of_shape(3, 3, pins={"all": SimpleNamespace(where="edges", clip=0.0)}, bending="none")
    stiffness, mass = (2 * 3 / 4 + 4 * 3 / 16) * 2000.0, 0.15 * 0.02**2  # two threads, four diagonals at 45 degrees
    assert spectrum.top_frequency(held) == pytest.approx(np.sqrt(stiffness / mass), rel=1e-9)
    large, cut = of_shape(90, 70), spectrum.CUT
    part = spectrum.top_frequency(large)
    spectrum.CUT = 1000
    try:
        assert part == pytest.approx(spectrum.top_frequency(large), rel=2e-3)
    finally:
        spectrum.CUT = cut


def test_limits_with_damped_threads():
    """Both rules as they are where damping vanishes, is critical, is strong."""
    omega = 1e4
    assert SymplecticEuler.bound(0.0, omega).seconds == pytest.approx(2e-4)
    assert SymplecticEuler.bound(2.0 / omega, omega).seconds == pytest.approx(2e-4 * (np.sqrt(2.0) - 1.0))
    assert ExplicitEuler.bound(0.0, omega).seconds == 0.0
    assert ExplicitEuler.bound(1e-4, omega).seconds == 1e-4
    assert ExplicitEuler.bound(4.0 / omega, omega).seconds == pytest.approx(2e-4 / (2.0 + np.sqrt(3.0)))


def test_a_rolled_and_a_twisted_sheet_store_what_a_plate_does():
    """B kappa^2/2 over the differences' area for z = kappa x^2/2, B kappa^2 for z = kappa x y; tilted, nothing."""
    sheet = of_shape(12, 9, bending="isometric")
    times, (x, y) = spectrum.stiffness_of(sheet, springs=False), sheet.uv.T
    wide, long = 8 * 0.02, 11 * 0.02

    def energy(z):
        u = np.column_stack([0.0 * z, 0.0 * z, z])
        return 0.5 * (u * times(u)).sum()

    assert energy(x**2 / 2) == pytest.approx(0.5 * sheet.bending * wide * (long - 0.02))
    assert energy(y**2 / 2) == pytest.approx(0.5 * sheet.bending * long * (wide - 0.02))
    assert energy(x * y) == pytest.approx(sheet.bending * wide * long)
    assert abs(energy(0.3 + 2.0 * x - y)) < 1e-12 * energy(x * y)


@pytest.fixture(scope="module")
def explicit():
    return {name: spawn(scenes.explicit, name, *how) for name, how in scenes.EXPLICIT.items()}


@pytest.mark.parametrize("name", scenes.EXPLICIT)
def test_an_explicit_solver_stands_under_its_limit_and_falls_beyond(name, explicit):
    found = explicit[name]
    stands, falls = found["growth"]
    assert stands < 10.0 and not falls < 1e6
    assert found["edge"] == pytest.approx(1.0, abs=0.1)
    ratios = np.array(found["errors"][:-1]) / found["errors"][1:]
    assert np.all((1.8 < ratios) & (ratios < 2.2))  # order 1
    assert found["drift"][0] < 1e-11 and found["drift"][1] < 1e-6  # damped bending holds back turning a little
    assert found["strain"] < 0.105
    assert f"cloth.{name}.substep_max" in found["words"][0] and "1.1 x" in found["words"][0]
    if name == "explicit_euler":
        assert not any(energy < 2.0 for energy in found["undamped"])
        assert "at every dt" in found["words"][1]


@pytest.mark.parametrize("name", ["implicit_euler", "xpbd"])
def test_the_others_hold_at_a_hundred_times_that(name):
    found = spawn(scenes.steady, name)
    assert found["speed"] < 20.0 and found["length"] < 2.0
    ratios = np.array(found["errors"][:-1]) / found["errors"][1:]
    assert np.all((1.8 < ratios) & (ratios < 2.2))
    assert found["drift"][0] < 1e-11 and found["drift"][1] < 0.02
    assert found["strain"] < 0.105


def test_threads_change_nothing(explicit):
    one = explicit["symplectic_euler"]["fall"]
    two = spawn(scenes.fall, "symplectic_euler", *scenes.EXPLICIT["symplectic_euler"], threads=2)
    assert np.array_equal(one, two)


def test_another_order_in_memory_changes_rounding_at_most():
    """Turns are by [i, j], wherever on the board these stand."""
    plain, wider = spawn(scenes.two_boards, "xpbd")
    assert np.abs(plain - wider).max() < 1e-12


def test_the_elastica_bends_as_tables_have_it():
    for gamma, bent in ((1.0, 0.1246), (10.0, 1.067), (100.0, 5.888)):
        drop, reach = cantilever.elastica(gamma)
        assert drop / reach == pytest.approx(bent, rel=1e-3)
    assert catenary.sag(0.4, 0.3) == pytest.approx(0.11768, rel=1e-3)


def test_a_cantilever_coarse():
    """Ten spacings and a half, stiff enough that a long substep would bend too far if bending were not minded."""
    run = run_point(cantilever.CASE, cantilever.of(10.0, "xpbd", 10), threads=1)
    assert abs(run["error"]) < 0.05
    assert run["gamma"] == pytest.approx(10.0)


def test_what_does_not_fit_is_refused_or_told(scene_file):
    with pytest.raises(ConfigError, match='cloth.method = "implicit_euler": feels no water.*choose xpbd'):
        config.load("seep", ["cloth.method=implicit_euler"])
    told = config.load(scene_file(), ["cloth.method=explicit_euler"]).warnings
    assert "gains energy at every dt" in told[0]
    assert not config.load(
        scene_file(), ["cloth.method=explicit_euler", "cloth.explicit_euler.retardation=1 ms"]
    ).warnings


def test_an_edge_is_a_clip():
    sheet = build_sheet(config.load("cantilever").cloth)
    assert list(sheet.pins) == list(range(6))  # two rows of three
    back = build_sheet(config.load("cantilever", ["cloth.pins.clamp.where=back", "cloth.pins.clamp.clip=0 mm"]).cloth)
    assert list(back.pins % 3) == [2] * 22
