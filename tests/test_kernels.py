"""Smoothing kernels: integral, gradient, support, the lattice, and the share beyond a plane."""

import math

import numpy as np
import pytest

from sim.maths.kernels import (
    KERNELS,
    largest_eigenvalue,
    lattice_points,
    lattice_shares,
    viscosity_laplacian,
    wall_fit,
)

H = 1.3
STEP = 1e-5


@pytest.fixture(params=sorted(set(KERNELS) - {"mueller"}))
def kernel(request):
    return KERNELS[request.param]


def _radial(kernel, count: int = 4001) -> tuple[np.ndarray, np.ndarray]:
    r = np.linspace(0.0, H, count)
    return r, np.array([kernel.value(a, H) for a in r])


def test_integral_is_one(kernel):
    r, w = _radial(kernel)
    assert np.trapezoid(4.0 * np.pi * r * r * w, r) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("q", [0.05, 0.3, 0.5, 0.7, 0.95])
def test_slope_is_the_derivative_over_r(kernel, q):
    r = q * H
    difference = (kernel.value(r + STEP, H) - kernel.value(r - STEP, H)) / (2.0 * STEP)
    assert kernel.slope(r, H) * r == pytest.approx(difference, rel=1e-4, abs=1e-6)


@pytest.mark.parametrize("r", [H, 1.01 * H, 3.0 * H])
def test_nothing_beyond_the_support(kernel, r):
    assert kernel.value(r, H) == kernel.slope(r, H) == 0.0


@pytest.mark.parametrize("d", [0.0, 0.1, 0.5, 0.64, 0.66, 0.9, 1.2])
def test_wall_is_the_integral_beyond_a_plane_and_its_derivative(kernel, d):
    r, w = _radial(kernel, 40001)
    beyond = r >= d
    share, slope = kernel.wall(d, H)
    assert share == pytest.approx(np.trapezoid((2.0 * np.pi * w * r * (r - d))[beyond], r[beyond]), abs=1e-5)
    difference = (kernel.wall(d + STEP, H)[0] - kernel.wall(d - STEP, H)[0]) / (2.0 * STEP)
    assert slope == pytest.approx(difference, rel=1e-3, abs=1e-6)


def test_inside_a_wall_the_share_is_the_rest(kernel):
    assert kernel.wall(-0.4, H)[0] == pytest.approx(1.0 - kernel.wall(0.4, H)[0])


def test_lattice_sums_are_the_known_ones():
    assert lattice_shares(KERNELS["wendland_c2"], 2.0)[0] == pytest.approx(1.034, abs=1e-3)
    assert lattice_shares(KERNELS["cubic_spline"], 2.0)[0] == pytest.approx(1.000, abs=1e-3)


@pytest.mark.parametrize("support", [2.0, 3.0])
def test_lowest_lattice_layer_on_a_wall_has_rest_density_and_no_net_pull(kernel, support):
    whole, beyond = lattice_shares(kernel, support)
    reach, offset = wall_fit(kernel, support)
    share, slope = kernel.wall(0.5 + offset, reach)
    assert 1.0 - beyond / whole + share == pytest.approx(1.0, abs=1e-9)
    above = [p for p in lattice_points(support) if p[2] > 0]
    pull = sum(kernel.slope(math.dist(p, (0, 0, 0)), support) * p[2] for p in above) / whole
    assert slope == pytest.approx(2.0 * pull)


@pytest.mark.parametrize("name", ["wendland_c2", "cubic_spline"])
def test_jacobi_needs_smaller_steps_at_larger_support(name):
    kernel = KERNELS[name]
    small, large = (largest_eigenvalue(kernel, s) for s in (2.0, 3.0))
    assert 2.0 < small < 3.0 < large < 8.0
    assert math.isfinite(large)


def test_mueller_counts_by_poly6_and_pushes_by_spiky():
    both, count, push = KERNELS["mueller"], KERNELS["poly6"], KERNELS["spiky"]
    for r in (0.0, 0.4, 1.1):
        assert both.value(r, H) == count.value(r, H) and both.slope(r, H) == push.slope(r, H)
        assert both.wall(r, H) == (count.wall(r, H)[0], push.wall(r, H)[1])


def test_kernels_of_the_report_are_those_of_its_appendix():
    r = 0.7
    assert KERNELS["poly6"].value(r, H) == pytest.approx(315 * (H**2 - r**2) ** 3 / (64 * math.pi * H**9))
    assert KERNELS["spiky"].slope(r, H) * r == pytest.approx(-45 * (H - r) ** 2 / (math.pi * H**6))
    assert viscosity_laplacian(r, H) == pytest.approx(45 * (H - r) / (math.pi * H**6))


def test_viscosity_laplacian_gives_the_laplacian_of_a_parabola():
    """v = x^2, lap v = 2: the integral of x^2 lap W, which is that of r^2 lap W/3."""
    r = np.linspace(0.0, H, 4001)
    w = np.array([viscosity_laplacian(a, H) for a in r])
    assert np.trapezoid(4.0 * np.pi * r**4 / 3.0 * w, r) == pytest.approx(2.0, abs=1e-5)
