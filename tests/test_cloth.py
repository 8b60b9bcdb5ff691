"""The cloth alone: springs, sag, limits, contact, momentum, bits."""

import math

import cloth_scenes as scenes
import numpy as np
import pytest
from spawned import spawn

from sim.studies import drapes


@pytest.fixture(scope="module")
def sheet():
    from sim.scene.cloth import build_sheet

    return build_sheet(scenes.cloth(spacing=0.01, slack=0.15, pins=scenes.corners(), strain_limit=0.1))


def test_sheet_weighs_what_its_area_does(sheet):
    assert sheet.mass.sum() == pytest.approx(scenes.AREA_DENSITY * 0.04)
    assert np.all((sheet.inv_mass == 0.0) == np.isin(np.arange(len(sheet.x)), sheet.pins))


def test_patches_face_the_normal(sheet):
    x = np.column_stack([sheet.uv, np.zeros(len(sheet.uv))])
    a, b, c = (x[sheet.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    assert np.all(normal[:, 2] > 0.0)
    assert 0.5 * normal[:, 2].sum() == pytest.approx(0.04)
    for p, corners in enumerate(sheet.patches):
        assert set(sheet.triangles[2 * p]) | set(sheet.triangles[2 * p + 1]) == set(corners)


def test_clips_stand_where_slack_puts_them(sheet):
    x = sheet.x.reshape(*sheet.shape, 3)
    assert x[-1, 0, 0] - x[0, 0, 0] == pytest.approx(0.17)
    assert np.linalg.norm(x[1, 1] - x[0, 0]) == pytest.approx(0.01 * math.sqrt(2.0))


def test_hanging_begins_without_compressed_threads(sheet):
    from sim.scene.cloth import spring_list

    springs = spring_list(sheet, ("structural_u", "structural_v"))
    length = np.linalg.norm(sheet.x[springs.ends[:, 1]] - sheet.x[springs.ends[:, 0]], axis=1)
    assert np.abs(length / springs.rest - 1.0).max() < 1e-9


def test_a_sheet_held_all_round_begins_without_taut_threads():
    from sim.scene.cloth import build_sheet, spring_list

    hems = {"hems": scenes.SimpleNamespace(where="edges", clip=0.0)}
    sheet = build_sheet(scenes.cloth(spacing=0.01, slack=0.2, pins=hems))
    springs = spring_list(sheet, ("structural_u", "structural_v"))
    length = np.linalg.norm(sheet.x[springs.ends[:, 1]] - sheet.x[springs.ends[:, 0]], axis=1)
    assert (length / springs.rest).max() == pytest.approx(1.0, abs=1e-6)
    assert sheet.x[:, 2].min() < 0.2 - 0.03


def test_springs_add_up_to_the_fabric(sheet):
    """C11 = ks + kh + 4 kf = 9/8 Y, C12 = kh = 3/8 Y: energy of uniform strain, by hand."""
    from sim.scene.cloth import spring_list

    springs = spring_list(sheet)
    d = sheet.uv[springs.ends[:, 1]] - sheet.uv[springs.ends[:, 0]]
    for strain, modulus in (((1.0, 0.0), 9 / 8), ((1.0, 1.0), 3.0), ((1.0, -1.0), 1.5)):
        extension = (d**2 * strain).sum(1) / springs.rest
        energy = 0.5 * (springs.stiffness * extension**2).sum() / 0.04
        assert energy == pytest.approx(0.5 * modulus * scenes.STRETCH, rel=1e-9)


def test_a_spring_swings_in_two_pi_root_m_over_k():
    """m = rho a^2/2 on ks = 3/4 Y and two diagonals of kh = 3/8 Y at 45 degrees: k = 9/8 Y."""
    mass, stiffness = scenes.AREA_DENSITY * 0.02**2 / 2, 9 / 8 * scenes.STRETCH
    assert spawn(scenes.oscillation) == pytest.approx(2.0 * math.pi * math.sqrt(mass / stiffness), rel=0.01)


def test_hanging_and_pulled_sheets_give_the_fabric_back():
    """Grips slide sideways. Elongation rho_A g L/(2 Y) of a hanging sheet; Y and nu = 1/3 of a stretched one."""
    (hung, _, _), (along, across, tension) = spawn(scenes.pulled)
    assert hung == pytest.approx(scenes.AREA_DENSITY * scenes.GRAVITY * 0.2 / (2.0 * scenes.STRETCH), rel=0.02)
    assert tension / 0.004 == pytest.approx(scenes.STRETCH, rel=0.02)
    assert -across / along == pytest.approx(1.0 / 3.0, rel=0.02)


def test_a_strip_hangs_as_a_catenary():
    """Length 0.4 m between ends 0.3 m apart: sinh(q)/q = 4/3, sag = 0.15 (cosh q - 1)/q (Bernoulli 1691)."""
    q = 1.3513
    assert math.sinh(q) / q == pytest.approx(4.0 / 3.0, rel=1e-3)
    assert spawn(scenes.strip, length=0.4, distance=0.3) == pytest.approx(0.15 * (math.cosh(q) - 1.0) / q, rel=0.02)


def test_a_taut_strip_sags_by_the_cube_root_of_its_weight():
    """s^3 = 3 q L^4/(64 Y), q = rho_A g: a parabola's length against T = q L^2/(8 s)."""
    dry, wet = spawn(scenes.taut)
    sag = (3.0 * scenes.AREA_DENSITY * scenes.GRAVITY * 0.2**4 / (64.0 * scenes.STRETCH)) ** (1.0 / 3.0)
    assert dry == pytest.approx(sag, rel=0.03)
    assert wet == pytest.approx(2.0 ** (1.0 / 3.0) * sag, rel=0.03)


def test_a_free_sheet_keeps_its_momentum():
    """Springs, strain limit and damping, of bending too, of a sheet that tumbles and crumples; f64."""
    (linear, angular), (linear_after, angular_after), energy, _, slowed = spawn(scenes.tumbling)
    assert np.abs(linear_after - linear).max() < 1e-12 * np.abs(linear).max()
    assert np.abs(angular_after - angular).max() < 1e-3 * np.abs(angular).max()
    assert energy < 0.01
    assert slowed == pytest.approx(1.0, rel=0.02)  # B tau d^4 v/dx^4


def test_no_spring_passes_the_strain_limit():
    assert spawn(scenes.loaded, force=1.2) < 0.105


def test_a_dropped_sheet_rests_on_solids():
    depth, speed, low, high = spawn(scenes.dropped)
    assert depth < 1e-6
    assert speed < 5e-3
    assert low == pytest.approx(2e-4, abs=1e-5) and 0.06 < high < 0.09


def test_threads_do_not_change_a_bit():
    one, energy, strain = spawn(scenes.hung, threads=1)
    two, *_ = spawn(scenes.hung, threads=2)
    assert np.array_equal(one, two)
    assert energy < 1e-6 and strain < 0.05


def test_a_drape_coefficient_is_by_the_shadow():
    """A flat square's is 1; folded double, (1/2 - s)/(1 - s) with the support's share s."""
    x, triangles = np.array([(0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0)], np.float32), [[0, 1, 2], [0, 2, 3]]
    assert drapes.coefficient(x, np.array(triangles), 0.01, 0.002) == pytest.approx(1.0, abs=0.03)
    x[:, 0] *= 0.5
    assert drapes.coefficient(x, np.array(triangles), 0.01, 0.002) == pytest.approx(0.375, abs=0.03)
