"""The thin lens: round trips, limits, and a ray traced through it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.thin_lens import (
    aperture_radius_mm,
    blur_radius_um,
    circle_of_confusion_um,
    depth_from_blur_m,
    depth_of_field_m,
    hyperfocal_distance_m,
    image_distance_mm,
    magnification,
    object_distance_m,
)

focal_lengths = st.floats(1.0, 400.0)
distances = st.floats(0.5, 1000.0)
f_numbers = st.floats(0.95, 32.0)


@given(focal_lengths, distances)
def test_image_and_object_distance_are_each_others_inverse(f_mm: float, d_m: float) -> None:
    v_mm = image_distance_mm(d_m, f_mm)
    assert object_distance_m(v_mm, f_mm) == pytest.approx(d_m, rel=1e-6)
    assert 1 / f_mm == pytest.approx(1 / float(v_mm) + 1 / (d_m * 1e3), rel=1e-12)


@given(focal_lengths)
def test_infinite_or_unknown_focus_puts_the_sensor_at_the_focal_length(f_mm: float) -> None:
    assert image_distance_mm(np.inf, f_mm) == f_mm
    assert image_distance_mm(np.nan, f_mm) == f_mm
    assert object_distance_m(f_mm, f_mm) == np.inf


def test_nothing_is_imaged_from_inside_the_focal_length() -> None:
    assert np.isnan(image_distance_mm(0.04, 50.0))
    assert np.isnan(magnification(0.05, 50.0))


@given(focal_lengths, distances)
def test_magnification_is_image_distance_over_object_distance(f_mm: float, d_m: float) -> None:
    expected = float(image_distance_mm(d_m, f_mm)) / (d_m * 1e3)
    assert magnification(d_m, f_mm) == pytest.approx(expected, rel=1e-9)


@given(focal_lengths, f_numbers, distances, distances)
def test_blur_is_what_rays_through_the_rim_of_the_lens_draw(
    f_mm: float, n: float, d_m: float, s_m: float
) -> None:
    """A ray leaves the object on the axis, passes the rim, is bent by its height over f."""
    rim_mm = f_mm / n / 2
    slope = rim_mm / (d_m * 1e3) - rim_mm / f_mm  # after the lens
    v_mm = float(image_distance_mm(s_m, f_mm))
    at_sensor_mm = abs(rim_mm + slope * v_mm)
    assert blur_radius_um(d_m, f_mm, n, s_m) == pytest.approx(at_sensor_mm * 1e3, abs=1e-3)


@given(focal_lengths, f_numbers, distances, distances)
def test_depth_comes_back_from_blur_on_its_branch(
    f_mm: float, n: float, d_m: float, s_m: float
) -> None:
    r_um = blur_radius_um(d_m, f_mm, n, s_m)
    branch = "near" if d_m <= s_m else "far"
    assert depth_from_blur_m(r_um, f_mm, n, s_m, branch) == pytest.approx(d_m, rel=1e-6)


@given(focal_lengths, f_numbers, distances)
def test_at_infinite_focus_it_is_eq_10(f_mm: float, n: float, d_m: float) -> None:
    r_um = blur_radius_um(d_m, f_mm, n, np.inf)
    a_mm = float(aperture_radius_mm(f_mm, n))
    assert r_um == pytest.approx(f_mm * a_mm / (d_m * 1e3) * 1e3, rel=1e-9)
    assert depth_from_blur_m(r_um, f_mm, n) == pytest.approx(f_mm * a_mm / (r_um * 1e-3) * 1e-3)
    assert np.isnan(depth_from_blur_m(r_um, f_mm, n, np.inf, "far"))


@given(focal_lengths, f_numbers, distances)
def test_a_far_blur_beyond_that_of_infinity_has_no_depth(f_mm: float, n: float, s_m: float) -> None:
    limit_um = float(blur_radius_um(np.inf, f_mm, n, s_m))
    assert np.isnan(depth_from_blur_m(1.01 * limit_um, f_mm, n, s_m, "far"))


@given(st.floats(10, 100), f_numbers, st.floats(5.0, 50.0))
def test_focused_at_the_hyperfocal_distance_infinity_is_just_sharp(
    f_mm: float, n: float, c_um: float
) -> None:
    h_m = hyperfocal_distance_m(f_mm, n, c_um)
    assert circle_of_confusion_um(np.inf, f_mm, n, h_m) == pytest.approx(c_um, rel=1e-6)
    near_m, far_m = depth_of_field_m(f_mm, n, h_m * 1.000001, c_um)
    assert far_m == np.inf
    # half of H, measured from the lens: Kingslake's approximation, exact to f / H
    assert near_m == pytest.approx(h_m / 2, rel=2 * f_mm / (h_m * 1e3) + 1e-5)


def test_arrays_broadcast_and_nan_stays_nan() -> None:
    out = blur_radius_um(np.array([[1.0], [np.nan]]), 50.0, np.array([1.8, 4.0]), 2.0)
    assert out.shape == (2, 2)
    assert np.isnan(out[1]).all()
    assert (out[0] > 0).all()


@given(st.floats(5.0, 300.0))
def test_focus_far_away_tends_to_infinite_focus(f_mm: float) -> None:
    excess_mm = image_distance_mm([1e4, 1e6, 1e9], f_mm) - f_mm
    assert (np.diff(excess_mm) < 0).all()
    d_m = np.array([0.8, 5.0, 80.0])
    near_infinity, infinity = blur_radius_um(d_m, f_mm, 2.8, 1e9), blur_radius_um(d_m, f_mm, 2.8)
    np.testing.assert_allclose(near_infinity, infinity, rtol=1e-6)


def test_blur_grows_away_from_the_focus_and_shrinks_with_the_f_number() -> None:
    d_m = np.linspace(0.5, 20.0, 200)
    r_um = blur_radius_um(d_m, 50.0, 2.0, 4.0)
    assert (np.diff(r_um[d_m < 4.0]) < 0).all()
    assert (np.diff(r_um[d_m > 4.0]) > 0).all()
    assert (np.diff(blur_radius_um(2.0, 50.0, [1.4, 2.0, 5.6, 16.0], 4.0)) < 0).all()


@given(st.floats(5.0, 300.0), f_numbers, distances, st.floats(1.0, 100.0))
def test_depth_of_field_ends_where_the_blur_is_as_large_as_allowed(
    f_mm: float, n: float, s_m: float, c_um: float
) -> None:
    near_m, far_m = depth_of_field_m(f_mm, n, s_m, c_um)
    assert near_m < s_m < far_m
    assert circle_of_confusion_um(near_m, f_mm, n, s_m) == pytest.approx(c_um, rel=1e-6)
    at_far_um = circle_of_confusion_um(far_m, f_mm, n, s_m)
    if np.isfinite(far_m):
        assert at_far_um == pytest.approx(c_um, rel=1e-6)
    else:
        assert at_far_um <= c_um * (1 + 1e-9)


def test_the_papers_aperture_radii() -> None:
    # Tables 3 and 6 print 7.81 for both
    np.testing.assert_allclose(aperture_radius_mm(50.0, [1.8, 3.5]), [13.8889, 7.1429], atol=5e-5)


def test_an_unknown_branch_is_refused() -> None:
    with pytest.raises(ValueError, match="near, far"):
        depth_from_blur_m(10.0, 50.0, 2.0, 4.0, "Near")  # type: ignore[arg-type]


@pytest.mark.parametrize(("f_mm", "n"), [(0.0, 2.0), (-50.0, 2.0), (50.0, 0.0), (50.0, -2.0)])
def test_a_lens_that_cannot_be_gives_nothing(f_mm: float, n: float) -> None:
    assert np.isnan(aperture_radius_mm(f_mm, n))
    assert np.isnan(blur_radius_um(3.0, f_mm, n))
    assert np.isnan(depth_from_blur_m(3.0, f_mm, n))
    assert np.isnan(hyperfocal_distance_m(f_mm, n, 20.0))
