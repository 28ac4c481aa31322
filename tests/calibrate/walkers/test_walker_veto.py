"""Tracks of cars, of things that stand, and of people, each a solid that is projected here by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.calibrate.walkers.known_lengths import KnownHeight, KnownLengths
from pipeline.calibrate.walkers.pose_and_lens import calibrate_stored
from pipeline.calibrate.walkers.walker_veto import NotWalkers, check_walkers, likeness_of
from pipeline.core.arrays import FloatArray
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import ADULT
from pipeline.core.records import GroundPlane, Intrinsics
from pipeline.estimate.types import Measured

LENS = Intrinsics(1280, 720, 1000.0, 1000.0, 639.5, 359.5)
ROW = CameraRow("road", width_px=1280, height_px=720, intrinsics_source="recording")
PLANE = GroundPlane(6.0, np.deg2rad(15.0))
FRAME_S = 0.1


def box_of(at_m: tuple[float, float], size_m: tuple[float, float, float]) -> FloatArray:
    """Return the box of a solid: right and ahead of the camera's foot; its width, length, height."""
    ends = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
    corners = ends * size_m + [*at_m, 0.0]
    cos, sin = np.cos(PLANE.tilt_rad), np.sin(PLANE.tilt_rad)
    below = PLANE.camera_height_m - corners[:, 2]
    depth = corners[:, 1] * cos + below * sin
    column = LENS.cx_px + LENS.fx_px * corners[:, 0] / depth
    row = LENS.cy_px + LENS.fy_px * (below * cos - corners[:, 1] * sin) / depth
    return np.array([column.min(), row.min(), column.max(), row.max()])


def boxes_of(
    size_m: tuple[float, float, float], speed_m_s: float, count: int, seed: int = 0
) -> Measured:
    """Return tracks of solids that go along the camera's axis or across, each 0.1 taller or less."""
    random = np.random.default_rng(seed)
    rows = []
    for track in range(count):
        tall = np.array([1.0, 1.0, random.normal(1.0, 0.04)])
        across = track % 2 == 0
        start = np.array([random.uniform(-3, 3), random.uniform(12, 30)])
        for frame in range(25):
            way = speed_m_s * FRAME_S * (frame - 12)
            at = start + ([way, 0.0] if across else [0.0, -min(way, 6.0)])
            size = np.array(size_m)[[1, 0, 2] if across else [0, 1, 2]] * tall
            box = box_of((at[0], at[1]), (size[0], size[1], size[2]))
            if (box > 0).all() and (box < [1280, 720, 1280, 720]).all():
                rows.append((track, frame, *(box + random.normal(0, 0.4, 4))))
    table = np.array(rows)
    n, unknown = len(table), np.full(len(table), np.nan)
    return Measured(
        camera="road",
        observation_index=np.arange(n),
        frame_index=np.arange(n),
        capture_time_ns=(table[:, 1] * FRAME_S * 1e9).astype(np.int64),
        track_id=table[:, 0].astype(np.int64),
        class_name=np.full(n, "person", dtype=object),
        bbox_xyxy_px=table[:, 2:],
        std_xyxy_px=np.full((n, 4), 1.0),
        truncated=np.zeros((n, 4), dtype=bool),
        occlusion=np.zeros(n),
        f_number=unknown,
        focal_length_mm=unknown,
        focus_distance_m=unknown,
        pixel_pitch_x_um=unknown,
        pixel_pitch_y_um=unknown,
        intrinsics=LENS,
        ground_plane=None,
    )


CAR_M, PERSON_M, CHILD_M = (1.8, 4.3, 1.5), (0.5, 0.45, 1.7), (0.35, 0.35, 1.1)
POST_M = (0.3, 0.3, 1.5)


def test_cars_on_a_road_get_no_pose() -> None:
    with pytest.raises(NotWalkers, match="faster than"):
        calibrate_stored(boxes_of(CAR_M, 9.0, 12), ROW, ADULT)


def test_cars_get_no_pose_and_no_lens_where_no_lens_is_known() -> None:
    cars = replace(boxes_of(CAR_M, 9.0, 12), intrinsics=None)
    with pytest.raises(NotWalkers):
        calibrate_stored(cars, replace(ROW, intrinsics_source=None), ADULT)


def test_cars_in_a_queue_are_told_by_their_widths() -> None:
    slow = boxes_of(CAR_M, 1.5, 12)
    found = likeness_of(slow, "person", PLANE)
    assert not found.too_fast.any()
    with pytest.raises(NotWalkers, match="wider than a person"):
        found.check()


def test_bicycles_are_told_by_their_speed() -> None:
    found = likeness_of(boxes_of((0.6, 0.6, 1.75), 5.0, 12), "person", PLANE)
    assert not found.too_wide.any()
    with pytest.raises(NotWalkers, match="faster than"):
        found.check()


def test_things_that_stand_are_not_walkers() -> None:
    with pytest.raises(NotWalkers, match="slow walk"):
        check_walkers(boxes_of(POST_M, 0.0, 12), "person", PLANE)


@pytest.mark.parametrize("size_m", [PERSON_M, CHILD_M])
@pytest.mark.parametrize("speed_m_s", [0.7, 1.3, 2.2])
def test_people_and_children_pass(size_m: tuple[float, float, float], speed_m_s: float) -> None:
    walkers = boxes_of(size_m, speed_m_s, 12)
    for plane in (None, PLANE):
        found = likeness_of(walkers, "person", plane)
        found.check()
        assert not found.too_wide.any()
    assert np.median(found.speed) == pytest.approx(speed_m_s / 1.7, rel=0.1)


def test_those_who_stand_may_stand_beside_those_who_walk() -> None:
    stand, walk = boxes_of(PERSON_M, 0.0, 16), boxes_of(PERSON_M, 1.3, 4, seed=1)
    walk = replace(walk, track_id=walk.track_id + 100)
    names = ("bbox_xyxy_px", "std_xyxy_px", "capture_time_ns", "track_id", "class_name")
    both = {n: np.concatenate([getattr(stand, n), getattr(walk, n)]) for n in names}
    twice = {n: np.resize(getattr(stand, n), (len(both["track_id"]), 4)) for n in ("truncated",)}
    occlusion = np.zeros(len(both["track_id"]))
    check_walkers(replace(stand, **both, **twice, occlusion=occlusion), "person", PLANE)


def test_a_few_cars_among_walkers_do_not_cost_the_pose() -> None:
    found = likeness_of(boxes_of(PERSON_M, 1.3, 12), "person", PLANE)
    fast = replace(found, speed=np.where(np.arange(12) < 5, 8.0, found.speed))
    fast.check()
    with pytest.raises(NotWalkers):
        replace(found, speed=np.where(np.arange(12) < 7, 8.0, found.speed)).check()


def test_whoever_gives_a_height_says_that_they_are_people() -> None:
    walkers = boxes_of((0.5, 0.45, 1.7), 1.3, 12)
    pose = calibrate_stored(walkers, ROW, ADULT).plane
    assert pose.camera_height_m == pytest.approx(6.0, rel=0.1)
    quick = replace(walkers, capture_time_ns=walkers.capture_time_ns // 5)
    with pytest.raises(NotWalkers):
        calibrate_stored(quick, ROW, ADULT)
    known = KnownLengths(heights=(KnownHeight(0, 1.7),))
    assert calibrate_stored(quick, ROW, ADULT, known).plane.camera_height_m > 4.0
