"""The outline of a body, beside balls and points that are projected."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, height_m, project_person
from pipeline.optics.silhouette import (
    CROWN_RADIUS,
    axis_rows,
    mean_reach,
    per_stature,
    silhouette_rows,
)

CAMERAS = st.tuples(
    st.floats(2.0, 9.0), st.floats(0.0, 0.8), st.floats(3.0, 40.0), st.floats(0.9, 2.0)
)


def rows(camera_height_m: float, tilt: float, ahead_m: float, tall_m: float) -> tuple[float, float]:
    foot, head = project_person(0.0, ahead_m, tall_m, camera_height_m, tilt)
    return float(foot[1]), float(head[1])


@given(CAMERAS, st.floats(-0.1, 0.4))
def test_the_axis_of_a_silhouette_is_found(
    camera: tuple[float, float, float, float], reach: float
) -> None:
    foot, head = rows(*camera)
    low, high = silhouette_rows(foot, head, camera[1], reach)
    assert axis_rows(low, high, camera[1], reach) == (
        pytest.approx(foot, abs=1e-7),
        pytest.approx(head, abs=1e-7),
    )


@given(CAMERAS, st.floats(0.0, 0.3))
def test_the_ends_are_a_point_of_the_ground_and_the_outline_of_a_ball(
    camera: tuple[float, float, float, float], reach: float
) -> None:
    above_m, tilt, ahead_m, tall_m = camera
    low, high = silhouette_rows(*rows(*camera), tilt, reach)
    near, _ = rows(above_m, tilt, ahead_m - reach * tall_m, tall_m)
    assert low == pytest.approx(near, abs=1e-9)
    angle = np.linspace(0, 2 * np.pi, 20_000)
    radius_m = CROWN_RADIUS * tall_m
    y_m = ahead_m + radius_m * np.cos(angle)
    drop_m = above_m - (tall_m - radius_m + radius_m * np.sin(angle))
    depth_m = y_m * np.cos(tilt) + drop_m * np.sin(tilt)
    ball = ((drop_m * np.cos(tilt) - y_m * np.sin(tilt)) / depth_m).min()
    assert high == pytest.approx(ball, abs=1e-6)


def test_a_silhouette_seems_taller_than_the_person_by_what_is_stated() -> None:
    above_m, tilt, ahead_m, tall_m, reach = 5.0, 0.6, 6.0, 1.7, 0.12
    low, high = silhouette_rows(*rows(above_m, tilt, ahead_m, tall_m), tilt, reach)
    seems_m = height_m(foot_depth_m(above_m, tilt, low), low, high, tilt)
    assert seems_m / tall_m == pytest.approx(float(per_stature(high, tilt, reach)), rel=1e-9)
    assert seems_m > 1.07 * tall_m


def test_the_lower_end_is_nearer_by_the_reach() -> None:
    above_m, tilt, ahead_m, tall_m = 4.0, 0.4, 10.0, 1.6
    low, _ = silhouette_rows(*rows(above_m, tilt, ahead_m, tall_m), tilt, 0.2)
    _, y_m = ground_position_m(foot_depth_m(above_m, tilt, low), 0.0, low, tilt)
    assert ahead_m - y_m == pytest.approx(0.2 * tall_m)


def test_who_comes_reaches_farther_than_who_goes_and_who_goes_than_who_passes() -> None:
    comes, goes, passes = (float(mean_reach(0.3, s, s * s)) for s in (1.0, -1.0, 0.0))
    assert comes > goes > passes > 0
    assert passes < mean_reach(0.3) < comes
