"""The direction in which people walk, and so how far before them their silhouettes end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.methods import ground
from pipeline.optics.silhouette import mean_reach, steepness
from tests.estimate.scenes import measured, outlined, people

PLANE = GroundPlane(5.0, 0.35, 0.0)
TALL_M = 1.75


def walk(heading_rad: float, speed_m_s: float = 1.3) -> tuple[object, np.ndarray]:
    """Return boxes of a body that walks through (0, 12 m), 25 a second, and where it is ahead."""
    time_s = np.arange(100) * 0.04
    x_m = speed_m_s * np.cos(heading_rad) * (time_s - 2)
    y_m = 12 + speed_m_s * np.sin(heading_rad) * (time_s - 2)
    box = people(x_m, y_m, np.full(100, TALL_M), PLANE)
    box = outlined(box, PLANE, heading_rad)
    return measured(box, ground_plane=PLANE, std_xyxy_px=np.ones((100, 4))), y_m


@pytest.mark.parametrize("heading_deg", [-90, -30, 0, 60, 90])
def test_walkers_are_put_where_they_are_and_are_as_tall(heading_deg: float) -> None:
    m, y_m = walk(np.deg2rad(heading_deg))
    found = ground.estimate(with_reach(m), Config())
    assert np.median(found.y_m - y_m) == pytest.approx(0.0, abs=0.02)
    assert np.median(found.height_m) == pytest.approx(TALL_M, abs=0.01)
    lines = ground.estimate(
        with_reach(replace(m, class_name=np.full(100, "car", object))), Config()
    )
    assert np.median(lines.y_m - y_m) < -0.03


def test_of_who_stands_the_reach_is_the_mean_and_less_sure() -> None:
    m, _ = walk(0.0, speed_m_s=0.0)
    stands, walks = with_reach(m), with_reach(walk(0.0)[0])
    steep, _ = steepness(stands.head[:, 1], PLANE.tilt_rad)
    assert stands.reach == pytest.approx(mean_reach(steep), abs=0.003)
    assert np.median(stands.reach_std) > 1.3 * np.median(walks.reach_std)


def test_without_a_pose_boxes_are_taken_as_they_are() -> None:
    m, _ = walk(0.0)
    assert with_reach(replace(m, ground_plane=None)).reach is None
