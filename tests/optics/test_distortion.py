"""The distortion models against OpenCV's, and their inverse up to where they fold over."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from pipeline.optics.distortion import (
    DISTORTION_MODELS,
    brown_curve,
    check_distortion,
    distort,
    fisheye_curve,
    undistort,
)

PLUMB_BOB = (-0.3, 0.1, 0.001, -0.002, 0.01)
KINECT = (0.5, -2.6, 0.0006, -0.0003, 1.5, 0.39, -2.4, 1.4)  # a usual rational fit
THIN_PRISM = (-0.2, 0.05, 0.001, 0.001, 0.0, 0.01, 0.02, 0.003, 0.001, -0.002, 0.003, 0.0005)
TILTED = (*THIN_PRISM, 0.03, -0.05)
BROWN = [PLUMB_BOB[:4], PLUMB_BOB, KINECT, THIN_PRISM, TILTED]
FISHEYE = [(0.0, 0.0, 0.0, 0.0), (-0.01, 0.002, -0.003, 0.0004), (0.08, -0.02, 0.01, -0.002)]

grid = np.stack(np.meshgrid(np.linspace(-0.9, 0.9, 31), np.linspace(-0.6, 0.6, 21)), axis=-1)


def opencv_brown(xy, d):
    points = np.concatenate([xy.reshape(-1, 2), np.ones((xy.size // 2, 1))], axis=1)
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(d))
    return pixels.reshape(xy.shape)


def opencv_fisheye(xy, d):
    return cv2.fisheye.distortPoints(xy.reshape(-1, 1, 2), np.eye(3), np.array(d)).reshape(xy.shape)


@pytest.mark.parametrize("d", BROWN, ids=len)
@pytest.mark.parametrize("model", ["plumb_bob", "rational_polynomial"])
def test_brown_bends_as_opencv_does(model, d):
    np.testing.assert_allclose(distort(grid, model, d), opencv_brown(grid, d), atol=1e-13)


@pytest.mark.parametrize("d", FISHEYE)
@pytest.mark.parametrize("model", ["equidistant", "kannala_brandt", "fisheye"])
def test_fisheye_bends_as_opencv_does(model, d):
    xy = grid * 4  # to 75 degrees off the axis
    np.testing.assert_allclose(distort(xy, model, d), opencv_fisheye(xy, d), atol=1e-13)


@pytest.mark.parametrize("d", BROWN, ids=len)
def test_brown_is_undone_as_opencv_does(d):
    bent = opencv_brown(grid, d)
    ours = undistort(bent, "rational_polynomial", d)
    np.testing.assert_allclose(ours, grid, atol=1e-12)
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    theirs = cv2.undistortPoints(
        bent.reshape(-1, 1, 2), np.eye(3), np.array(d), None, None, None, criteria
    )
    inner = np.abs(grid).max(axis=-1) < 0.5  # where OpenCV's iteration converges too
    np.testing.assert_allclose(ours[inner], theirs.reshape(grid.shape)[inner], atol=1e-6)


@pytest.mark.parametrize("d", FISHEYE)
def test_fisheye_is_undone_as_opencv_does(d):
    xy = grid * 2
    bent = opencv_fisheye(xy, d)
    ours = undistort(bent, "equidistant", d)
    np.testing.assert_allclose(ours, xy, atol=1e-11)
    theirs = cv2.fisheye.undistortPoints(bent.reshape(-1, 1, 2), np.eye(3), np.array(d))
    np.testing.assert_allclose(ours, theirs.reshape(xy.shape), atol=1e-6)


k_radial = st.floats(-0.5, 0.5)
k_small = st.floats(-0.01, 0.01)
angles = st.floats(0, 2 * np.pi)
fractions = st.floats(0.0, 0.99)


@given(k_radial, k_radial, k_radial, st.tuples(k_small, k_small, k_small), fractions, angles)
def test_radial_models_round_trip_all_the_way_to_their_limit(k1, k2, k3, rational, share, angle):
    d = (k1, k2, 0.0, 0.0, k3, *rational)
    r = share * min(brown_curve(d).limit, 10.0)
    xy = r * np.array([np.cos(angle), np.sin(angle)])
    there_and_back = undistort(distort(xy, "rational_polynomial", d), "rational_polynomial", d)
    np.testing.assert_allclose(there_and_back, xy, atol=1e-6)


@given(k_radial, k_radial, k_small, k_small, st.floats(0, 0.7), angles)
def test_tangential_models_round_trip_or_say_nothing(k1, k2, p1, p2, share, angle):
    d = (k1, k2, p1, p2, 0.0)
    r = share * min(brown_curve(d).limit, 2.0)
    xy = r * np.array([np.cos(angle), np.sin(angle)])
    back = undistort(distort(xy, "plumb_bob", d), "plumb_bob", d)
    np.testing.assert_allclose(back, xy, atol=1e-7)


@given(st.tuples(*[st.floats(-0.2, 0.2)] * 4), fractions, angles)
def test_fisheyes_round_trip_all_the_way_to_their_limit(d, share, angle):
    theta = share * min(fisheye_curve(d).limit, 1.5)
    xy = np.tan(theta) * np.array([np.cos(angle), np.sin(angle)])
    back = undistort(distort(xy, "equidistant", d), "equidistant", d)
    np.testing.assert_allclose(np.arctan(np.hypot(*back)), theta, atol=1e-7)


@given(st.tuples(*[k_radial] * 3), st.tuples(*[st.floats(-0.1, 0.5)] * 3))
def test_up_to_its_limit_the_curve_rises_and_there_it_turns(k, rational):
    assume(k != rational)  # then the pole is in the numerator too
    d = (k[0], k[1], 0.0, 0.0, k[2], *rational)
    curve = brown_curve(d)
    r = np.linspace(0, min(curve.limit, 30.0), 4000)[:-1]
    assert (np.diff(curve.at(r)) > -1e-12).all()
    if curve.limit < 900:
        before, beyond = curve.limit * (1 - 1e-4), curve.limit * (1 + 1e-4)
        turns = curve.slope(beyond) <= 0
        jumps = curve.at(beyond) < curve.at(before)  # a pole: from +infinity to -infinity
        assert turns or jumps


def test_the_limit_of_a_barrel():
    # r + k1 r^3 turns at r = 1 / sqrt(-3 k1), where it is 2/3 of that
    assert brown_curve((-0.3,)).limit == pytest.approx(1 / np.sqrt(0.9))
    assert fisheye_curve((-0.3,)).limit == pytest.approx(1 / np.sqrt(0.9))
    assert brown_curve((0.3,)).limit == 1e3  # a cushion rises for ever; 89.94 degrees will do
    assert fisheye_curve((0.0,)).limit == pytest.approx(np.pi / 2, abs=0.0011)
    assert brown_curve((0, 0, 0, 0, 0, -0.25)).limit == pytest.approx(2.0)  # a pole


def test_beyond_the_limit_neither_way_gives_an_answer():
    d = (-0.3, 0.0, 0.0, 0.0, 0.0)
    turn = 2 / 3 / np.sqrt(0.9)  # 0.7027
    assert np.isfinite(undistort([turn * 0.999, 0.0], "plumb_bob", d)).all()
    # Newton's method alone finds (-2.16, -0.24) for the first of these: through the fold, upside down.
    outside = np.array([[0.9, 0.1], [turn * 1.001, 0.0], [2.0, 0.0], [0.0, -5.0]])
    assert np.isnan(undistort(outside, "plumb_bob", d)).all()
    assert np.isnan(undistort(outside, "plumb_bob", (-0.3, 0.0, 0.001, 0.0))).all()
    # and what OpenCV would draw into the picture, folded over, has no image
    seen_by_opencv = opencv_brown(np.array([[1.5, 0.0]]), d)
    assert abs(seen_by_opencv[0, 0]) < turn
    assert np.isnan(distort([1.5, 0.0], "plumb_bob", d)).all()
    assert np.isnan(undistort([2.0, 0.0], "fisheye", (-0.3, 0.0, 0.0, 0.0))).all()


def test_the_centre_stays_and_the_unknown_stays_unknown():
    for model, d in [("plumb_bob", PLUMB_BOB), ("equidistant", FISHEYE[1]), ("", ())]:
        np.testing.assert_array_equal(undistort([0.0, 0.0], model, d), [0.0, 0.0])
        np.testing.assert_array_equal(distort([0.0, 0.0], model, d), [0.0, 0.0])
        mixed = undistort([[np.nan, 0.1], [0.1, 0.1]], model, d)
        assert np.isnan(mixed[0]).any()
        assert np.isfinite(mixed[1]).all()


def test_a_fisheye_with_all_zeros_is_still_a_fisheye():
    xy = np.array([1.0, 0.0])
    np.testing.assert_allclose(distort(xy, "equidistant", ()), [np.pi / 4, 0.0])
    np.testing.assert_allclose(distort(xy, "plumb_bob", (0.0,) * 5), xy)


def test_shapes_are_kept():
    for shape in [(2,), (0, 2), (3, 2), (2, 3, 2)]:
        for model, d in [("plumb_bob", PLUMB_BOB), ("equidistant", FISHEYE[1]), ("none", ())]:
            assert undistort(np.full(shape, 0.1), model, d).shape == shape
            assert distort(np.full(shape, 0.1), model, d).shape == shape


def test_what_is_not_a_model_is_refused():
    with pytest.raises(ValueError, match=r"'panini' is not one of plumb_bob, .*fisheye"):
        check_distortion("panini", ())
    with pytest.raises(ValueError, match="has 4 coefficients, not 5"):
        check_distortion("equidistant", (0.1, 0.0, 0.0, 0.0, 0.2))
    with pytest.raises(ValueError, match="not all finite"):
        check_distortion("plumb_bob", (0.1, np.nan))
    for model in DISTORTION_MODELS:
        check_distortion(model, (0.1, 0.0, 0.0, 0.0, 0.0))


@given(st.lists(st.floats(-1e300, 1e300), max_size=14))
def test_no_finite_coefficients_break_it(d):
    undistort(grid, "rational_polynomial", tuple(d))
    undistort(grid, "fisheye", tuple(d[:4]))


@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9))
def test_every_answer_is_right(x, y):
    """The inverse, distorted again, gives the point: for all models, wherever there is an inverse."""
    for d in BROWN:
        xy = undistort([x, y], "rational_polynomial", d)
        if np.isfinite(xy).all():
            np.testing.assert_allclose(distort(xy, "rational_polynomial", d), [x, y], atol=1e-9)
    for d in FISHEYE:
        xy = undistort([x, y], "fisheye", d)
        assume(np.isfinite(xy).all())
        np.testing.assert_allclose(distort(xy, "fisheye", d), [x, y], atol=1e-9)
