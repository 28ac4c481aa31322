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
