import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import j1, ndtr

from pipeline.optics.defocus import (
    diffraction_sigma_um,
    dioptres,
    disc_edge_spread,
    disc_sigma,
    edge_spread,
    radius_per_dioptre_um,
    resolvable_radius,
)
from pipeline.optics.thin_lens import blur_radius_um


def semicircle(x, radius):
    return 2 * np.sqrt(max(radius**2 - x**2, 0.0)) / (np.pi * radius**2)


def test_the_standard_deviation_across_an_edge_of_a_disc_is_half_its_radius():
    # A thousand squared points of a disc, projected on a line.
    at = (np.arange(1000) + 0.5) / 500 - 1
    x, y = np.meshgrid(at, at)
    inside = x**2 + y**2 <= 1
    assert np.std(3.0 * x[inside]) == pytest.approx(disc_sigma(3.0), rel=1e-3)


@given(st.floats(-1.2, 1.2))
def test_the_edge_of_a_disc_is_the_integral_of_its_semicircle(u):
    area, _ = quad(lambda x: semicircle(x, 1.0), -1.0, np.clip(u, -1, 1))
    assert disc_edge_spread(u) == pytest.approx(area, abs=1e-6)


def test_the_edge_spread_goes_from_a_gaussian_to_a_disc():
    x = np.linspace(-3, 3, 61)
    assert edge_spread(x, 0.0) == pytest.approx(ndtr(x), abs=2e-4)
    assert edge_spread(x, 1.0) == pytest.approx(disc_edge_spread(x / 2), abs=4e-3)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_edge_spread_has_unit_variance_and_is_the_convolution(share):
    x = np.linspace(-5.9, 5.9, 4001)
    slope = np.gradient(edge_spread(x, share), x)
    assert np.trapezoid(slope, x) == pytest.approx(1.0, abs=1e-3)
    assert np.trapezoid(slope * x**2, x) == pytest.approx(1.0, abs=5e-3)
    radius, sigma = 2 * np.sqrt(share), np.sqrt(1 - share)
    value, _ = quad(lambda t: semicircle(t, radius) * ndtr((0.7 - t) / sigma), -radius, radius)
    assert edge_spread(0.7, share) == pytest.approx(value, abs=1e-3)


def test_the_edge_of_an_airy_pattern_is_as_steep_as_the_gaussian_that_stands_for_it():
    # Integrate (2 J1(w) / w)^2 along one direction for the line spread at its centre, over the whole.
    scale_um = 0.55 * 4.0

    def airy(distance_um):
        w = np.pi * max(distance_um, 1e-9) / scale_um
        return (2 * j1(w) / w) ** 2

    line, _ = quad(airy, 0, 400 * scale_um, limit=4000)
    # The whole: the integral over the plane is 4 (lambda N)^2 / pi.
    slope = 2 * line / (4 * scale_um**2 / np.pi)
    assert 1 / (np.sqrt(2 * np.pi) * slope) == pytest.approx(diffraction_sigma_um(4.0), rel=1e-3)


@given(st.floats(0.3, 50.0), st.floats(0.3, 50.0), st.floats(1.4, 22.0))
def test_the_blur_circle_grows_with_dioptres_from_the_plane_of_focus(depth_m, focus_m, f_number):
    u = abs(dioptres(focus_m) - dioptres(depth_m))
    radius_um = radius_per_dioptre_um(50.0, f_number, focus_m) * u
    assert radius_um == pytest.approx(
        blur_radius_um(depth_m, 50.0, f_number, focus_m), rel=1e-9, abs=1e-9
    )


def test_infinite_focus_is_zero_dioptres():
    assert dioptres([np.inf, 2.0]) == pytest.approx([0.0, 0.5])


def test_at_the_resolvable_limit_the_disc_adds_twice_what_is_not_known():
    radius = resolvable_radius(0.6, 0.13)
    assert (radius / 2) ** 2 == pytest.approx(2 * (2 * 0.6 * 0.13))
