"""Boxes along a track: noise goes, walks stay, outliers do not pull, and what is filled in is wide."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.track.rows import BoxRows, filled
from pipeline.track.smoothing import WIDEST, smoothed

RATE = 10.0


def walk(count: int = 80, track: int = 0, start: float = 100.0, speed: float = 12.0) -> BoxRows:
    """Return somebody who walks to the right, 100 px tall and 30 wide."""
    time_s = np.arange(count) / RATE
    x = start + speed * time_s
    box = np.stack([x - 15, np.full(count, 200.0), x + 15, np.full(count, 300.0)], axis=1)
    measured, whole, person = (np.ones(count, dtype=bool) for _ in range(3))
    colour = np.full((count, 4), np.nan)
    std = np.full((count, 4), 2.0)
    frame = np.arange(count)
    return BoxRows(
        frame, frame, time_s, np.full(count, track), box, std, measured, whole, person, colour
    )


def with_boxes(rows: BoxRows, box: np.ndarray) -> BoxRows:
    from dataclasses import replace

    return replace(rows, bbox_xyxy_px=box)


def test_a_straight_walk_stays_as_it_is() -> None:
    rows = walk()
    box, std = smoothed(rows)
    assert box == pytest.approx(rows.bbox_xyxy_px, abs=1e-3)
    assert (std < rows.std_px).all()


def test_independent_noise_shrinks_as_the_deviations_say() -> None:
    random = np.random.default_rng(3)
    rows = walk(400)
    noisy = with_boxes(rows, rows.bbox_xyxy_px + random.normal(0, 2, (400, 4)))
    box, std = smoothed(noisy)
    left = (box - rows.bbox_xyxy_px)[20:-20]
    assert np.std(left[:, 3]) < 0.5 * 2.0
    # The stated one keeps what neighbours have in common, which this noise has not.
    assert np.std(left[:, 3]) < std[20:-20, 3].mean() < 0.8 * 2.0


def test_one_box_with_a_shadow_in_it_does_not_pull_the_others() -> None:
    rows = walk()
    box = rows.bbox_xyxy_px.copy()
    box[40] += [-40, 0, 0, 40]
    new, _ = smoothed(with_boxes(rows, box))
    assert np.abs(new[[38, 42]] - rows.bbox_xyxy_px[[38, 42]]).max() < 1.0
    assert abs(new[40, 3] - 300) < 4.0


def test_people_are_no_wider_than_people_and_other_things_may_be() -> None:
    rows = walk()
    box = rows.bbox_xyxy_px + np.array([-40, 0, 40, 0])
    wide, _ = smoothed(with_boxes(rows, box))
    assert (wide[:, 2] - wide[:, 0]) == pytest.approx(WIDEST * 100, rel=0.01)
    rows.person[:] = False
    as_it_is, _ = smoothed(with_boxes(rows, box))
    assert (as_it_is[:, 2] - as_it_is[:, 0]) == pytest.approx(110, rel=0.01)


def test_cut_boxes_stay_and_teach_nothing() -> None:
    rows = walk()
    box = rows.bbox_xyxy_px.copy()
    box[:10, 3] = 250
    rows.whole[:10] = False
    new, _ = smoothed(with_boxes(rows, box))
    assert new[:10] == pytest.approx(box[:10])
    assert new[12:, 3] == pytest.approx(300, abs=0.01)


def test_gaps_are_filled_up_to_the_limit_and_say_so() -> None:
    rows = walk()
    kept = np.ones(80, dtype=bool)
    kept[20:25] = kept[40:60] = False
    all_rows = filled(rows.take(kept), rows.time_s, 1.0)
    assert sorted(set(range(80)) - set(all_rows.frame.tolist())) == list(range(40, 60))
    box, std = smoothed(all_rows)
    between = ~all_rows.measured
    assert all_rows.frame[between].tolist() == list(range(20, 25))
    assert box[between] == pytest.approx(rows.bbox_xyxy_px[20:25], abs=0.01)
    assert std[between].min() > 3 * std[~between].max()


def test_tracks_do_not_touch_each_other() -> None:
    one, other = walk(), walk(track=1, start=700.0, speed=-30.0)
    both, _ = smoothed(one.with_rows(other))
    assert both[:80] == pytest.approx(smoothed(one)[0])
    assert both[80:] == pytest.approx(smoothed(other)[0])
