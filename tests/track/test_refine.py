"""Tracks refined: identities through meetings, any stretch of time at once, links by colour and place."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from pipeline.track.refine import Refiner
from pipeline.track.rows import BoxRows

RATE = 10.0


def person(track: int, frames: range, x: np.ndarray, hue: int, foot: float = 300.0) -> BoxRows:
    """Return somebody of a colour, 100 px tall, at x in each frame."""
    count = len(frames)
    frame = np.array(frames)
    box = np.stack([x - 14, np.full(count, foot - 100), x + 14, np.full(count, foot)], axis=1)
    yes = np.ones(count, dtype=bool)
    colour = np.zeros((count, 8))
    colour[:, hue] = 1.0
    return BoxRows(
        frame, frame, frame / RATE, np.full(count, track), box, np.ones((count, 4)), yes, yes, yes,
        colour,
    )  # fmt: skip


def in_time(*people: BoxRows) -> BoxRows:
    rows = people[0]
    for one in people[1:]:
        rows = rows.with_rows(one)
    rows = rows.take(np.lexsort((rows.track, rows.frame)))
    columns = {f.name: getattr(rows, f.name) for f in fields(rows)}
    return BoxRows(**columns | {"number": np.arange(len(rows))})


def refined(rows: BoxRows, stretch: int = 20_000, together: int = 10_000) -> BoxRows:
    """Return rows refined, given some frames at a time."""
    refiner = Refiner(np.arange(int(rows.frame.max()) + 1) / RATE, stretch)
    found = []
    for begin in range(0, int(rows.frame.max()) + 1, together):
        refiner.add(rows.take((rows.frame >= begin) & (rows.frame < begin + together)))
        found.append(refiner.ready())
    found.append(refiner.ready(last=True))
    parts = [part for part in found if part is not None]
    result = parts[0]
    for part in parts[1:]:
        result = result.with_rows(part)
    return result


def track_of(result: BoxRows, x: float, frame: int) -> int:
    mine = (
        (result.frame == frame) & (result.bbox_xyxy_px[:, 0] < x) & (result.bbox_xyxy_px[:, 2] > x)
    )
    assert mine.sum() == 1
    return int(result.track[mine][0])


def test_who_is_lost_behind_a_post_and_found_again_is_one_track() -> None:
    x = 100 + 8.0 * np.arange(100)
    rows = in_time(person(0, range(40), x[:40], 1), person(1, range(48, 100), x[48:], 1))
    result = refined(rows)
    assert len(np.unique(result.track)) == 1
    assert result.frame.tolist() == list(range(100))
    assert (~result.measured).sum() == 8


def test_people_in_other_clothes_are_not_joined() -> None:
    x = 100 + 8.0 * np.arange(100)
    rows = in_time(person(0, range(40), x[:40], 1), person(1, range(48, 100), x[48:], 5))
    assert len(np.unique(refined(rows).track)) == 2


def test_two_who_turn_back_where_they_meet_keep_their_identity_by_colour() -> None:
    """A tracker that only looks ahead lets them pass through each other."""
    step = np.abs(np.arange(-40, 40))
    left, right = 300.0 - 6 * step - 12, 300.0 + 6 * step + 12
    before, after = slice(0, 37), slice(44, 80)
    rows = in_time(
        person(0, range(37), left[before], 1),
        person(1, range(37), right[before], 5),
        person(0, range(44, 80), right[after], 5),  # exchanged
        person(1, range(44, 80), left[after], 1),
    )
    result = refined(rows)
    assert track_of(result, left[5], 5) == track_of(result, left[75], 75)
    assert track_of(result, right[5], 5) == track_of(result, right[75], 75)


@pytest.mark.parametrize("stretch", [40, 150])
def test_a_stretch_after_another_is_as_all_at_once(stretch: int) -> None:
    random = np.random.default_rng(1)
    people = []
    for track in range(12):
        begin = int(random.integers(0, 500))
        length = int(random.integers(30, 120))
        x = 100.0 * track + 5.0 * np.arange(length) + random.normal(0, 1, length)
        hole = int(random.integers(10, 20))
        one = person(track, range(begin, begin + length), x, track % 8, 300.0 + 130 * track)
        people.append(one.take((np.arange(length) < hole) | (np.arange(length) > hole + 4)))
    rows = in_time(*people)
    whole, some = refined(rows), refined(rows, stretch, 20)
    assert some.frame.tolist() == whole.frame.tolist()
    order = [np.lexsort((r.bbox_xyxy_px[:, 3], r.frame)) for r in (whole, some)]
    assert some.bbox_xyxy_px[order[1]] == pytest.approx(whole.bbox_xyxy_px[order[0]], abs=0.3)
    pairs = set(zip(whole.track[order[0]].tolist(), some.track[order[1]].tolist(), strict=True))
    assert len(pairs) == len(np.unique(whole.track)) == 12
