"""Cadence from the boxes of people who walk, made up with a known one."""

import numpy as np
import pytest

from pipeline.estimate.cadence import cadences, possible
from tests.estimate.scenes import measured


def walkers(hz, rate=10.0, seconds=15.0, bob_px=2.0, noise_px=1.0, seed=1, **changes):
    """Return boxes of people who cross the picture, whose heads bob and legs swing at a cadence."""
    random = np.random.default_rng(seed)
    n = round(seconds * rate)
    boxes, tracks, times = [], [], []
    for track, f in enumerate(np.atleast_1d(hz)):
        t = np.arange(n) / rate
        error = np.zeros((n, 4))
        for i in range(n):
            fresh = random.normal(0, noise_px, 4)
            error[i] = fresh if i == 0 else 0.7 * error[i - 1] + fresh * np.sqrt(1 - 0.49)
        swing = np.cos(2 * np.pi * f * t + random.uniform(0, 6))
        tall = 120 + 2 * t
        half = 24 + bob_px * swing
        x, foot = 200 + 40 * t, 400 + 5 * t
        box = np.column_stack([x - half, foot - tall + bob_px * swing, x + half, foot])
        boxes.append(box + error)
        tracks.append(np.full(n, track))
        times.append((t * 1e9).astype(np.int64))
    box = np.concatenate(boxes)
    return measured(
        box,
        track_id=np.concatenate(tracks),
        capture_time_ns=np.concatenate(times),
        **changes,
    )


@pytest.mark.parametrize("rate", [7.0, 10.0, 25.0])
def test_cadences_are_found_with_deviations_that_are_true(rate):
    true = np.linspace(1.5, 2.3, 40)
    table = cadences(walkers(true, rate))
    assert len(table) > 30
    off = table["cadence_hz"].to_numpy() - true[table["track_id"].to_numpy()]
    assert np.median(np.abs(off)) < 0.02
    z = off / table["cadence_std_hz"].to_numpy()
    assert (np.abs(z) < 1.96).mean() > 0.9
    assert table["window_count"].to_numpy().max() == 3


def test_noise_has_no_cadence():
    table = cadences(walkers(np.full(60, 1.9), bob_px=0.0))
    assert len(table) <= 2


@pytest.mark.parametrize(
    "seen",
    [
        walkers(np.full(5, 1.9), rate=4.0, seconds=30),
        walkers(np.full(5, 1.9), filled=np.ones(750, dtype=np.bool_)),
        walkers(np.full(5, 1.9), class_name=np.full(750, "car", dtype=np.object_)),
    ],
    ids=["4 frames a second", "interpolated", "cars"],
)
def test_what_cannot_be_read_has_none(seen):
    assert len(cadences(seen)) == 0


def test_boxes_are_read_as_they_were_found_and_not_as_they_were_smoothed():
    seen = walkers(np.full(3, 1.9))
    flat = walkers(np.full(3, 1.9), bob_px=0.0, raw_bbox_xyxy_px=seen.bbox_xyxy_px)
    assert len(cadences(flat)) == 3


def test_a_clock_that_is_too_fast_shows_in_cadences_that_are_not_kept():
    seen = walkers(np.full(4, 2.8), rate=10.0)
    found = cadences(seen, np.full(len(seen), 1.5))
    assert np.median(found["cadence_hz"].to_numpy()) == pytest.approx(2.8, abs=0.03)
    assert found["speed_m_s"].to_pylist() == [1.5] * len(found)
    assert len(possible(found)) == 0
