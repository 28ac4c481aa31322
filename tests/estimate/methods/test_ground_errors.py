"""Every error of a ground depth is in its deviation: focal length, feet before the axis, both ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.geometry import REACH_CONVENTION_STD, Geometry
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.methods import ground
from pipeline.optics.silhouette import REACH_COMMON_STD, REACH_TRACK_STD
from tests.estimate.scenes import VGA, measured, people

PLANE = GroundPlane(5.0, 0.3)


def standing(depth_m: float, plane: GroundPlane, lens=VGA):
    n = 30
    box = people(np.zeros(n), np.full(n, depth_m), np.full(n, 1.75), PLANE)
    box[:, 0] -= 12
    box[:, 2] += 12
    return measured(
        box, ground_plane=plane, intrinsics=lens, capture_time_ns=np.arange(n) * 100_000_000
    )


@pytest.mark.parametrize("ahead_m", [8.0, 14.0])
def test_the_error_of_a_focal_length_is_in_depth_and_height(ahead_m: float) -> None:
    """A lens longer by a little beside the deviation that is stated for it."""
    relative = 0.03
    unsure = replace(PLANE, focal_covariance=np.array([0.0, 0.0, 0.0, relative**2]))
    found = ground.estimate(Geometry.of(standing(ahead_m, unsure)), Config())
    longer = replace(VGA, fx_px=VGA.fx_px * 1.0001, fy_px=VGA.fy_px * 1.0001)
    other = ground.estimate(Geometry.of(standing(ahead_m, PLANE, longer)), Config())
    for name in ("depth", "height"):
        slope = (getattr(other, f"{name}_m") - getattr(found, f"{name}_m")) / 1e-4
        std = getattr(found, f"{name}_std_m")
        np.testing.assert_allclose(std, np.abs(slope) * relative, rtol=0.02)
        assert (std > 0.001).all()


@pytest.mark.parametrize("recorded", [True, False])
def test_how_far_feet_are_before_the_axis_is_in_the_depth(recorded: bool) -> None:
    """Boxes and pose exact: what remains is the reach, of this person, of shoes, of how boxes end."""
    boxes = standing(12.0, PLANE)
    geometry = with_reach(replace(boxes, recorded=np.full(len(boxes), recorded)))
    assert geometry.reach is not None
    found = ground.estimate(geometry, Config())
    step = 1e-4
    farther = ground.estimate(
        geometry.with_reach(geometry.reach + step, geometry.reach_std), Config()
    )
    slope = (farther.depth_m - found.depth_m) / step
    convention = REACH_CONVENTION_STD * geometry.reach * recorded
    expected = np.abs(slope) * np.sqrt(REACH_TRACK_STD**2 + REACH_COMMON_STD**2 + convention**2)
    np.testing.assert_allclose(found.depth_common_std_m, expected, rtol=0.03)
    assert (expected > 0.01).all()


def test_reach_and_both_ends_are_in_the_height() -> None:
    """Slopes by differences: of the height by the reach, by the foot and by the head."""
    boxes = replace(standing(12.0, PLANE), recorded=np.full(30, False))
    geometry = with_reach(boxes)
    assert geometry.reach is not None
    found = ground.estimate(geometry, Config())
    step, step_px = 1e-4, 0.01
    farther = ground.estimate(
        geometry.with_reach(geometry.reach + step, geometry.reach_std), Config()
    )
    by_reach = (farther.height_m - found.height_m) / step
    expected = by_reach**2 * (REACH_TRACK_STD**2 + REACH_COMMON_STD**2)
    for side, std in zip((3, 1), geometry.common_std.T, strict=True):
        moved = boxes.bbox_xyxy_px.copy()
        moved[:, side] += step_px
        changed = with_reach(replace(boxes, bbox_xyxy_px=moved))
        changed = changed.with_reach(geometry.reach, geometry.reach_std)
        other = ground.estimate(changed, Config())
        expected += ((other.height_m - found.height_m) / step_px * VGA.fy_px * std) ** 2
    np.testing.assert_allclose(found.height_common_std_m, np.sqrt(expected), rtol=0.03)
