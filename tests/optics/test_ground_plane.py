"""A camera above the ground: projection and back, and Jacobians against finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics import ground_plane as ground

heights = st.floats(1.0, 12.0)
tilts = st.floats(0.05, 0.9)
rolls = st.floats(-0.1, 0.1)
lateral = st.floats(-8.0, 8.0)
ahead = st.floats(6.0, 60.0)
people = st.floats(0.8, 2.1)


@given(lateral, ahead, people, heights, tilts, rolls)
def test_who_is_projected_is_found_again(
    x_m: float, y_m: float, tall_m: float, h_m: float, tilt: float, roll: float
) -> None:
    foot, head = ground.project_person(x_m, y_m, tall_m, h_m, tilt, roll)
    if np.isnan(head).any():
        return
    foot, head = ground.remove_roll(foot, roll), ground.remove_roll(head, roll)
    depth_m = ground.foot_depth_m(h_m, tilt, foot[1])
    assert ground.height_m(depth_m, foot[1], head[1], tilt) == pytest.approx(tall_m, rel=1e-8)
    assert ground.depth_from_height_m(tall_m, foot[1], head[1], tilt) == pytest.approx(
        float(depth_m), rel=1e-8
    )
    right_m, ahead_m = ground.ground_position_m(depth_m, foot[0], foot[1], tilt)
    assert (right_m, ahead_m) == pytest.approx((x_m, y_m), abs=1e-8)
    # depth is along the axis: the foot's range times the cosine of its angle off the axis
    range_m = ground.range_m(x_m, y_m, h_m)
    assert depth_m == pytest.approx(float(range_m) / np.sqrt(1 + (foot**2).sum()), rel=1e-9)


@given(heights, tilts, ahead, people)
def test_jacobians_are_those_of_finite_differences(
    h_m: float, tilt: float, y_m: float, tall_m: float
) -> None:
    roll = 0.03
    foot, head = ground.project_person(2.0, y_m, tall_m, h_m, tilt, roll)
    if np.isnan(head).any():
        return

    def measure(p: np.ndarray) -> np.ndarray:
        f = ground.remove_roll(foot, p[2]) + np.array([0, p[3]])
        h = ground.remove_roll(head, p[2]) + np.array([0, p[4]])
        z = ground.foot_depth_m(p[0], p[1], f[1])
        return np.array([z, ground.height_m(z, f[1], h[1], p[1])])

    at = np.array([h_m, tilt, roll, 0.0, 0.0])
    numeric = np.stack(
        [(measure(at + d) - measure(at - d)) / 2e-6 for d in np.eye(5) * 1e-6], axis=1
    )
    f, h = ground.remove_roll(foot, roll), ground.remove_roll(head, roll)
    depth_by = np.array([*ground.depth_jacobian(h_m, tilt, f[0], f[1]), 0.0])
    np.testing.assert_allclose(depth_by, numeric[0], rtol=2e-3, atol=1e-5)
    height_by = np.array(ground.height_jacobian(h_m, tilt, f, h))
    np.testing.assert_allclose(height_by, numeric[1], rtol=2e-3, atol=1e-5)


@given(heights, tilts)
def test_the_horizon_and_what_is_above_it_have_no_depth(h_m: float, tilt: float) -> None:
    horizon = -np.tan(tilt)
    assert np.isnan(ground.foot_depth_m(h_m, tilt, horizon - 1e-6))
    assert ground.foot_depth_m(h_m, tilt, horizon + 1e-3) > 0


def test_a_level_camera_is_similar_triangles() -> None:
    assert ground.foot_depth_m(1.5, 0.0, 0.1) == pytest.approx(15.0)
    assert ground.height_m(15.0, 0.1, -0.02, 0.0) == pytest.approx(1.8)


def test_roll_goes_away_and_comes_back() -> None:
    points = np.random.default_rng(0).normal(size=(10, 2))
    np.testing.assert_allclose(ground.add_roll(ground.remove_roll(points, 0.2), 0.2), points)


def in_camera_frame(
    x_m: float, y_m: float, up_m: float, h_m: float, tilt: float, roll: float
) -> np.ndarray:
    """Project with rotation matrices instead: the world is x right, y ahead, z up."""
    cos, sin, cos_roll, sin_roll = np.cos(tilt), np.sin(tilt), np.cos(roll), np.sin(roll)
    upright = np.array([[1, 0, 0], [0, -sin, -cos], [0, cos, -sin]])  # right, down, ahead
    rolled = np.array([[cos_roll, sin_roll, 0], [-sin_roll, cos_roll, 0], [0, 0, 1]]) @ upright
    return np.asarray(rolled @ np.array([x_m, y_m, up_m - h_m]))


@given(lateral, ahead, people, heights, tilts, st.floats(-0.5, 0.5))
def test_people_are_projected_as_by_rotation_matrices(
    x_m: float, y_m: float, tall_m: float, h_m: float, tilt: float, roll: float
) -> None:
    foot, head = ground.project_person(x_m, y_m, tall_m, h_m, tilt, roll)
    for seen, up_m in ((foot, 0.0), (head, tall_m)):
        x, y, z = in_camera_frame(x_m, y_m, up_m, h_m, tilt, roll)
        if z > 0:
            np.testing.assert_allclose(seen, [x / z, y / z], rtol=1e-9, atol=1e-12)
        distance_m = ground.range_m(x_m, y_m, h_m, up_m)
        assert distance_m == pytest.approx(np.linalg.norm([x, y, z]))


def test_gravity_is_where_the_docstring_says() -> None:
    tilt, roll = 0.4, 0.2
    to_the_ground_below = in_camera_frame(0.0, 0.0, 0.0, 1.0, tilt, roll)
    stated = [np.sin(roll) * np.cos(tilt), np.cos(roll) * np.cos(tilt), np.sin(tilt)]
    np.testing.assert_allclose(to_the_ground_below, stated)


@given(heights, tilts, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_points_far_away_are_seen_on_the_horizon(
    h_m: float, tilt: float, slope: float, roll: float
) -> None:
    foot, _ = ground.project_person(slope * 1e9, 1e9, 1.7, h_m, tilt, roll)
    assert ground.horizon_y(tilt, foot[0], roll) == pytest.approx(foot[1], abs=1e-7)


@given(heights, tilts, ahead)
def test_farther_people_stand_nearer_the_horizon_and_all_scales(
    h_m: float, tilt: float, y_m: float
) -> None:
    y = ground.horizon_y(tilt) + np.array([1e-3, 1e-2, 0.1, 1.0])
    depth_m = ground.foot_depth_m(h_m, tilt, y)
    assert (np.diff(depth_m) < 0).all()
    np.testing.assert_allclose(ground.foot_depth_m(2 * h_m, tilt, y), 2 * depth_m)


def test_straight_down_the_ground_is_at_the_cameras_height() -> None:
    assert ground.foot_depth_m(6.0, np.pi / 2, [-0.3, 0.0, 0.3]) == pytest.approx([6.0] * 3)


def test_what_is_not_before_the_camera_is_unknown() -> None:
    foot, head = ground.project_person([0.0, 0.0], [-5.0, 5.0], 1.7, 3.0, 0.1)
    assert np.isnan(foot[0]).all()
    assert np.isnan(head[0]).all()
    assert np.isfinite(foot[1]).all()
    # a head whose ray leads back over the camera
    assert np.isnan(ground.height_m(3.0, 1.2, 2.0, 0.6))
    assert np.isnan(ground.depth_from_height_m(1.7, 2.5, 2.0, 0.6))
    # upside down
    assert np.isnan(ground.depth_from_height_m(1.7, 0.1, 0.2, 0.1))
    assert np.isnan(ground.foot_depth_m([0.0, -2.0, np.nan], 0.1, 0.3)).all()


@given(heights, tilts, rolls, ahead, people)
def test_the_jacobian_of_depth_from_height_is_that_of_finite_differences(
    h_m: float, tilt: float, roll: float, y_m: float, tall_m: float
) -> None:
    foot, head = ground.project_person(2.0, y_m, tall_m, h_m, tilt, roll)
    if np.isnan(head).any():
        return

    def measure(p: np.ndarray) -> np.ndarray:
        y_f = ground.remove_roll(foot, p[2])[1] + p[3]
        y_h = ground.remove_roll(head, p[2])[1] + p[4]
        return ground.depth_from_height_m(p[0], y_f, y_h, p[1])

    at = np.array([tall_m, tilt, roll, 0.0, 0.0])
    numeric = [(measure(at + d) - measure(at - d)) / 2e-6 for d in np.eye(5) * 1e-6]
    f, h = ground.remove_roll(foot, roll), ground.remove_roll(head, roll)
    analytic = ground.depth_from_height_jacobian(tall_m, tilt, f, h)
    np.testing.assert_allclose(analytic, numeric, rtol=2e-3, atol=1e-5)


def test_deviations_are_those_of_a_simulation() -> None:
    random = np.random.default_rng(11)
    n, h_m, tilt, roll = 200_000, 4.0, 0.3, 0.05
    covariance = np.array([[4e-4, 2e-5, 0.0], [2e-5, 4e-6, 1e-6], [0.0, 1e-6, 4e-6]])
    foot, head = ground.project_person(2.0, 12.0, 1.75, h_m, tilt, roll)
    pose = random.multivariate_normal([h_m, tilt, roll], covariance, n)
    y_f = ground.remove_roll(foot, pose[:, 2])[:, 1] + random.normal(0, 0.001, n)
    y_h = ground.remove_roll(head, pose[:, 2])[:, 1] + random.normal(0, 0.0015, n)
    depth_m = ground.foot_depth_m(pose[:, 0], pose[:, 1], y_f)
    tall_m = ground.height_m(depth_m, y_f, y_h, pose[:, 1])
    f, h = ground.remove_roll(foot, roll), ground.remove_roll(head, roll)
    depth_std_m = ground.foot_depth_std_m(h_m, tilt, f, 0.001, covariance)
    tall_std_m = ground.height_std_m(h_m, tilt, f, h, 0.001, 0.0015, covariance)
    assert depth_std_m == pytest.approx(depth_m.std(), rel=0.02)
    assert tall_std_m == pytest.approx(tall_m.std(), rel=0.02)
    assert np.mean(np.abs(tall_m - 1.75) < 1.96 * tall_std_m) == pytest.approx(0.95, abs=0.01)


def test_deviations_of_many_people_at_once() -> None:
    foot, head = ground.project_person(np.linspace(-3, 3, 5), np.full(5, 9.0), 1.7, 3.0, 0.2)
    covariance = np.diag([0.01, 1e-5, 1e-5])
    many = ground.height_std_m(3.0, 0.2, foot, head, 0.001, 0.001, covariance)
    one_by_one = [
        ground.height_std_m(3.0, 0.2, f, h, 0.001, 0.001, covariance)
        for f, h in zip(foot, head, strict=True)
    ]
    np.testing.assert_allclose(many, one_by_one)
