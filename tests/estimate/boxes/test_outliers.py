"""Boxes that do not fit their track: found from the track alone, with any pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bench.walkers import scene
from pipeline.estimate.boxes.outliers import height_off_px
from tests.estimate.scenes import measured


def boxes(head_px: np.ndarray, tall_px: np.ndarray) -> np.ndarray:
    left = np.full(len(head_px), 300.0)
    return np.stack([left, head_px, left + 40, head_px + tall_px], axis=1)


@given(
    st.integers(0, 2**32 - 1),
    st.floats(-0.3, 1.5),
    st.floats(0.0, 0.33),
    st.sampled_from([-0.4, -0.2, 0.3, 0.8]),
)
def test_what_is_off_the_line_is_found_and_by_how_much(
    seed: int, slope: float, share: float, off: float
) -> None:
    random = np.random.default_rng(seed)
    n = 60
    head = np.linspace(100, 160, n)
    tall = 120 + slope * (head - 100)
    bad = random.permutation(n) < share * n
    seen = tall * np.where(bad, 1 + off, 1.0) + random.normal(0, 0.3, n)
    m = measured(boxes(head, seen), std_xyxy_px=np.full((n, 4), 0.5))
    found = height_off_px(m, np.ones(n, bool))
    np.testing.assert_array_equal(found != 0, bad)
    np.testing.assert_allclose(found[bad], (tall * off)[bad], atol=3.0)


def test_nobody_is_found_where_nothing_is_wrong() -> None:
    random, share = np.random.default_rng(8), []
    for _ in range(15):
        m = scene(random, 8, bad_share=0.0).measured
        share.append(np.mean(height_off_px(m, np.ones(len(m), bool)) != 0))
    assert np.mean(share) < 0.005


def test_tracks_are_told_apart_and_short_ones_left_alone() -> None:
    head, tall = np.full(47, 100.0), np.full(47, 120.0)
    track = np.repeat([5, 2, 9], [20, 20, 7])
    tall[track == 2] = 60.0
    tall[[3, 44]] = 70.0
    found = height_off_px(measured(boxes(head, tall), track_id=track), np.ones(47, bool))
    assert np.flatnonzero(found).tolist() == [3]
    assert found[3] == pytest.approx(-50.0)


@given(st.integers(0, 2**32 - 1))
def test_the_order_of_rows_changes_nothing(seed: int) -> None:
    random = np.random.default_rng(seed)
    n = 50
    tall = random.normal(100, 8, n)
    assume(np.ptp(tall) > 0)
    m = measured(boxes(np.linspace(0, 50, n), tall), track_id=np.arange(n) % 3)
    order = random.permutation(n)
    names = [k for k in m.__slots__ if isinstance(getattr(m, k), np.ndarray)]

    shuffled = replace(m, **{k: getattr(m, k)[order] for k in names})
    use = np.ones(n, bool)
    np.testing.assert_allclose(height_off_px(shuffled, use), height_off_px(m, use)[order])


def test_who_is_not_usable_is_not_judged() -> None:
    m = measured(boxes(np.full(20, 100.0), np.where(np.arange(20) == 7, 50.0, 120.0)))
    use = np.arange(20) != 7
    assert not height_off_px(m, use).any()
    assert not height_off_px(m, np.zeros(20, bool)).any()
