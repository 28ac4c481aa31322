"""The pinhole with distortion, against OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.pinhole import PinholeCamera

BROWN = (-0.3, 0.1, 0.001, -0.002, 0.01)
RATIONAL = (-0.2, 0.05, 0.0005, 0.001, 0.002, 0.1, -0.01, 0.001)
FISHEYE = (0.01, -0.02, 0.001, 0.0005)


def camera(model: str, distortion: tuple[float, ...]) -> PinholeCamera:
    return PinholeCamera(900.0, 910.0, 630.0, 370.0, 1280, 720, model, distortion)


def matrix(c: PinholeCamera) -> np.ndarray:
    return np.array([[c.fx_px, 0, c.cx_px], [0, c.fy_px, c.cy_px], [0, 0, 1.0]])


def pixels(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform([50, 50], [1230, 670], (300, 2))


@pytest.mark.parametrize(
    ("model", "distortion"), [("plumb_bob", BROWN), ("rational_polynomial", RATIONAL)]
)
def test_undistortion_is_opencvs(model: str, distortion: tuple[float, ...]) -> None:
    c, points = camera(model, distortion), pixels()
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    theirs = cv2.undistortPoints(
        points[:, None], matrix(c), np.array(distortion), None, None, None, criteria
    )
    np.testing.assert_allclose(c.normalize(points), theirs[:, 0], atol=1e-9)


@pytest.mark.parametrize(
    ("model", "distortion"), [("plumb_bob", BROWN), ("rational_polynomial", RATIONAL)]
)
def test_projection_is_opencvs(model: str, distortion: tuple[float, ...]) -> None:
    c = camera(model, distortion)
    points = np.random.default_rng(1).uniform([-4, -3, 8], [4, 3, 30], (300, 3))
    zero = np.zeros(3)
    theirs, _ = cv2.projectPoints(points, zero, zero, matrix(c), np.array(distortion))
    np.testing.assert_allclose(c.project(points), theirs[:, 0], atol=1e-8)


def test_fisheye_is_opencvs() -> None:
    c, points = camera("equidistant", FISHEYE), pixels()
    theirs = cv2.fisheye.undistortPoints(points[:, None], matrix(c), np.array(FISHEYE))
    np.testing.assert_allclose(c.normalize(points), theirs[:, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("model", "distortion"),
    [("", ()), ("plumb_bob", BROWN), ("rational_polynomial", RATIONAL), ("equidistant", FISHEYE)],
)
def test_normalising_and_projecting_is_a_round_trip(
    model: str, distortion: tuple[float, ...]
) -> None:
    c, points = camera(model, distortion), pixels(3)
    rays = np.concatenate([c.normalize(points), np.ones((300, 1))], axis=1)
    np.testing.assert_allclose(c.project(rays * 7.0), points, atol=1e-6)


def test_what_cannot_be_undistorted_is_nan() -> None:
    strong = PinholeCamera(300.0, 300.0, 320.0, 240.0, 640, 480, "plumb_bob", (-0.5, 0, 0, 0))
    assert np.isnan(strong.normalize([[5000.0, 240.0]])).all()
    assert not np.isnan(strong.normalize([[330.0, 240.0]])).any()


def test_what_is_behind_the_camera_is_not_in_the_picture() -> None:
    assert np.isnan(camera("", ()).project([[0.0, 0.0, -1.0]])).all()


def test_an_unknown_model_is_named() -> None:
    with pytest.raises(ValueError, match="banana"):
        camera("banana", (1.0,))


@given(st.floats(0.1, 4.0), st.floats(0.1, 4.0))
def test_a_scaled_picture_shows_the_same_directions(sx: float, sy: float) -> None:
    c = camera("plumb_bob", BROWN)
    points = pixels(4)[:5]
    scaled = (points + 0.5) * [sx, sy] - 0.5
    np.testing.assert_allclose(c.scaled(sx, sy).normalize(scaled), c.normalize(points), atol=1e-9)


def test_what_the_lens_folds_over_is_neither_seen_nor_taken_for_a_direction() -> None:
    """Newton's method alone finds the far side of the axis for a pixel beyond the fold."""
    wide = PinholeCamera(300.0, 300.0, 640.0, 360.0, 1280, 720, "plumb_bob", (-0.3, 0, 0, 0))
    directions = wide.normalize([[640.0, 360.0], [840.0, 360.0], [910.0, 390.0], [1279.0, 719.0]])
    np.testing.assert_array_equal(np.isnan(directions).all(axis=1), [False, False, True, True])
    assert np.isnan(wide.project([2.0, 0.0, 1.0])).all()


def test_resizing_is_opencvs() -> None:
    picture = np.zeros((64, 64), np.float32)
    picture[20:24, 40:44] = 1.0  # its centre at (41.5, 21.5)
    small = cv2.resize(picture, None, fx=0.5, fy=0.25, interpolation=cv2.INTER_AREA)
    x, y = np.arange(32) @ small.sum(axis=0), np.arange(16) @ small.sum(axis=1)
    c = PinholeCamera(100.0, 100.0, 41.5, 21.5, 64, 64).scaled(0.5, 0.25)
    assert (c.cx_px, c.cy_px) == pytest.approx((x / small.sum(), y / small.sum()))
    assert (c.fx_px, c.fy_px, c.width_px, c.height_px) == (50.0, 25.0, 32, 16)
