"""The height of a track: its interval, and what one person cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.config import ADULT
from pipeline.estimate.track_heights import track_heights
from pipeline.estimate.types import Measured
from tests.estimate.scenes import estimates


def columns(heights: list[np.ndarray], common_m: float, class_name: str = "person"):
    """Return a track for each array of heights, a frame each, as a method would give it."""
    count = sum(len(h) for h in heights)
    track = np.repeat(np.arange(len(heights)), [len(h) for h in heights])
    unknown = np.full(count, np.nan)
    measured = Measured(
        camera="cam",
        observation_index=np.arange(count),
        frame_index=np.arange(count),
        capture_time_ns=np.arange(count) * 40_000_000,
        track_id=track,
        class_name=np.full(count, class_name, dtype=object),
        bbox_xyxy_px=np.zeros((count, 4)),
        std_xyxy_px=np.zeros((count, 4)),
        truncated=np.zeros((count, 4), bool),
        occlusion=np.zeros(count),
        f_number=unknown,
        focal_length_mm=unknown,
        focus_distance_m=unknown,
        pixel_pitch_x_um=unknown,
        pixel_pitch_y_um=unknown,
        intrinsics=None,
        ground_plane=None,
    )
    estimated = estimates(
        count,
        depth_m=np.full(count, 10.0),
        height_m=np.concatenate(heights),
        height_std_m=np.hypot(np.full(count, 0.03), common_m),
        height_common_std_m=np.full(count, common_m),
    )
    return measured, estimated


def heights_of(
    heights: list[np.ndarray], common_m: float = 0.0, name: str = "person"
) -> dict[str, list]:
    return track_heights(*columns(heights, common_m, name), "ground", [ADULT]).to_pydict()


def test_independent_frames_average_out_and_what_they_share_does_not() -> None:
    noise = np.random.default_rng(0).normal(1.7, 0.03, 2000)
    alone = heights_of([noise], name="post")
    assert alone["height_std_m"][0] == pytest.approx(0.03 * np.sqrt(np.pi / 2 / 2000), rel=0.15)
    shared = heights_of([noise], common_m=0.04, name="post")
    assert shared["height_std_m"][0] == pytest.approx(0.04, rel=0.01)


def test_intervals_of_correlated_frames_hold_the_truth() -> None:
    """AR(1) noise with a correlation of 0.9: the 95 % interval must not shrink with sqrt(n)."""
    random, tracks = np.random.default_rng(1), []
    for _ in range(400):
        error = np.zeros(200)
        for i in range(1, 200):
            error[i] = 0.9 * error[i - 1] + random.normal(0, 0.013)
        tracks.append(1.75 + error)
    found = heights_of(tracks, name="post")
    z = (np.array(found["height_m"]) - 1.75) / np.array(found["height_std_m"])
    assert 0.91 < np.mean(np.abs(z) < 1.96) < 0.985


def test_what_one_person_cannot_be_is_marked() -> None:
    found = heights_of([np.full(20, h) for h in (1.55, 1.68, 1.95, 3.3, 0.6)])
    assert found["height_plausible"] == [True, True, True, False, False]


def test_nothing_is_said_of_classes_without_a_prior() -> None:
    table = track_heights(*columns([np.full(9, 4.0)], 0.0, "truck"), "ground", [ADULT])
    assert table["height_plausible"].to_pylist() == [None]
