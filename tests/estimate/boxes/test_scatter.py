"""Errors of a track's boxes, from the scatter of its own heights: their size, and how long they last."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimate.boxes.scatter import BEST, Scatter, scatter_of
from pipeline.estimate.gait import GAIT_STD_M
from tests.estimate.scenes import estimates, measured

STEP_S = 0.125
STATED_M = 0.05


def scattered(error_m: np.ndarray, stated_m: float = STATED_M, step_s: float = STEP_S) -> Scatter:
    """Return what comes of heights, (tracks, frames), with these errors of the boxes."""
    tracks, frames = error_m.shape
    count = tracks * frames
    time_ns = np.tile(np.arange(frames) * round(step_s * 1e9), tracks)
    m = measured(
        np.zeros((count, 4)), track_id=np.repeat(np.arange(tracks), frames), capture_time_ns=time_ns
    )
    bob = np.random.default_rng(9).normal(0, GAIT_STD_M, count)
    ground = estimates(
        count,
        height_m=1.7 + error_m.reshape(-1) + bob,
        height_std_m=np.full(count, np.hypot(stated_m, 0.03)),
        height_common_std_m=np.full(count, 0.03),
    )
    return scatter_of(m, ground, np.zeros(count))


def lasting(random: np.random.Generator, shape: tuple[int, int], lasts_s: float) -> np.ndarray:
    """Return errors of one deviation whose correlation is exp(-t / tau); they last for 2 tau."""
    keep = np.exp(-STEP_S * 2 / lasts_s)
    error = random.normal(0, 1, shape)
    for i in range(1, shape[1]):
        error[:, i] = keep * error[:, i - 1] + np.sqrt(1 - keep**2) * error[:, i]
    return error


@pytest.mark.parametrize("true_ratio", [0.3, 1.0, 2.0])
def test_the_variance_of_boxes_is_found_beside_the_gait(true_ratio: float) -> None:
    error = np.random.default_rng(1).normal(0, STATED_M * np.sqrt(true_ratio), (200, 160))
    found = scattered(error).ratio.reshape(200, 160)
    assert (found == found[:, :1]).all()
    # with fewer tails than there are, and a little of what is taken for known beforehand
    assert np.median(found) == pytest.approx(true_ratio, rel=0.2)


def test_exact_boxes_are_as_good_as_can_be_told() -> None:
    assert np.median(scattered(np.zeros((20, 400))).ratio) < 2 * BEST


@pytest.mark.parametrize("lasts_s", [0.5, 1.0])
def test_how_long_errors_last_is_found(lasts_s: float) -> None:
    error = STATED_M * lasting(np.random.default_rng(2), (100, 400), lasts_s)
    found = np.median(scattered(error).correlation_s)
    # the heights' errors are those of the boxes and of the gait, which does not last
    box = STATED_M**2 / (STATED_M**2 + GAIT_STD_M**2)
    assert found == pytest.approx(lasts_s * box, rel=0.25)


def test_white_errors_last_no_longer_than_a_frame_or_so() -> None:
    error = np.random.default_rng(3).normal(0, STATED_M, (50, 800))
    assert np.median(scattered(error).correlation_s) < 2 * STEP_S


def test_a_short_track_is_trusted_less_and_a_single_frame_as_it_says() -> None:
    error = np.random.default_rng(4).normal(0, STATED_M, (40, 8))
    assert np.median(scattered(error).ratio) > 2
    np.testing.assert_allclose(scattered(error[:, :1]).ratio, 1.0)


def test_hidden_feet_in_some_frames_do_not_make_the_others_worthless() -> None:
    error = np.random.default_rng(5).normal(0, STATED_M, (40, 160))
    error[:, 60:90] -= 0.6
    assert np.median(scattered(error).ratio) < 4
