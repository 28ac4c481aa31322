"""Smoothed heights along a track: steadier, with correct intervals; a person who sits down still does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimate.fusion.smooth_heights import smooth_heights
from pipeline.estimate.types import Estimated, Measured
from tests.estimate.scenes import estimates, measured

STEP_S = 0.1
NOISE_M, COMMON_M = 0.05, 0.1


def track(height_m: np.ndarray, tracks: int = 1) -> tuple[Measured, Estimated]:
    n = len(height_m)
    each = n // tracks
    m = measured(
        np.tile([600.0, 300.0, 640.0, 400.0], (n, 1)),
        track_id=np.repeat(np.arange(tracks), each),
        capture_time_ns=np.tile(np.arange(each), tracks) * round(STEP_S * 1e9),
    )
    seen = estimates(
        n,
        height_m=height_m,
        height_common_std_m=np.full(n, COMMON_M),
        height_std_m=np.full(n, np.hypot(NOISE_M, COMMON_M)),
    )
    return m, seen


@pytest.mark.parametrize("lasts_s", [STEP_S, 1.0])
def test_errors_shrink_and_the_deviations_say_by_how_much(lasts_s: float) -> None:
    tracks, each = 400, 60
    random = np.random.default_rng(3)
    keep = np.exp(-2 * STEP_S / lasts_s) if lasts_s > STEP_S else 0.0
    error = np.empty((tracks, each))
    error[:, 0] = random.normal(0, NOISE_M, tracks)
    for i in range(1, each):  # AR(1): twice the integral of its autocorrelation is `lasts_s`
        new = random.normal(0, NOISE_M * np.sqrt(1 - keep**2), tracks)
        error[:, i] = keep * error[:, i - 1] + new
    m, seen = track(1.75 + error.ravel(), tracks)
    seen = smooth_heights(m, seen, np.full(len(m), lasts_s))
    off = (seen.height_m - 1.75).reshape(tracks, each)
    assert off.std(axis=1).mean() < 0.8 * error.std(axis=1).mean()
    noise_m = np.sqrt(seen.height_std_m**2 - COMMON_M**2)
    inside = np.abs(off.ravel()) < 1.96 * noise_m
    # The smoother allows for changes of posture that are not there.
    assert 0.93 < inside.mean() < 0.999


def test_what_frames_have_in_common_stays() -> None:
    m, seen = track(np.full(80, 1.75))
    seen = smooth_heights(m, seen)
    assert (seen.height_std_m >= COMMON_M).all()
    assert (seen.height_common_std_m == COMMON_M).all()


def test_who_sits_down_is_seen_to() -> None:
    time_s = np.arange(100) * STEP_S
    true_m = 1.75 - 0.45 * np.clip((time_s - 5.0) / 1.0, 0.0, 1.0)
    m, seen = track(true_m + np.random.default_rng(5).normal(0, NOISE_M, 100))
    seen = smooth_heights(m, seen, np.full(100, STEP_S))
    assert np.abs(seen.height_m - true_m).max() < 0.12
    assert seen.height_m[:40].mean() == pytest.approx(1.75, abs=0.02)
    assert seen.height_m[70:].mean() == pytest.approx(1.30, abs=0.03)


def test_what_was_put_in_is_left_alone_and_does_not_count() -> None:
    m, seen = track(np.full(40, 1.75))
    height_m, assumed = seen.height_m.copy(), np.zeros(40, dtype=np.bool_)
    assumed[10:20], height_m[10:20], height_m[30] = True, 1.2, np.nan
    before, seen = height_m, replace(seen, height_m=height_m, height_assumed=assumed)
    seen = smooth_heights(m, seen)
    assert (seen.height_m[10:20] == 1.2).all()
    assert np.isnan(seen.height_m[30])
    measured_rows = ~seen.height_assumed & np.isfinite(before)
    assert seen.height_m[measured_rows] == pytest.approx(1.75, abs=1e-6)
