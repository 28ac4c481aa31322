"""Tracks: identities through crossings and gaps, and the filter against a textbook one."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.config import TrackConfig
from pipeline.core.records import Boxes
from pipeline.track.kalman import ACCELERATION_STD, FOOT_STD, SPEED_STD
from pipeline.track.tracker import Tracker

FRAME_NS = 40_000_000


def boxes(rows: list[tuple[float, float, float]], ids: tuple[str | None, ...] = ()) -> Boxes:
    """Return boxes of people by foot x, foot y and height."""
    array = np.array(
        [(x - 0.15 * h, y - h, x + 0.15 * h, y) for x, y, h in rows], dtype=float
    ).reshape(-1, 4)
    count = len(rows)
    return Boxes(
        array, np.ones(count), ("person",) * count, np.ones((count, 4)), ids or (None,) * count
    )


def follow(paths: list[list[tuple[float, float, float] | None]]) -> list[list[int | None]]:
    """Return the track id of each path in each frame."""
    tracker, result = Tracker(TrackConfig(), "cam"), []
    for index in range(len(paths[0])):
        seen = [p for p, path in enumerate(paths) if path[index] is not None]
        ids = tracker.update(index * FRAME_NS, index, boxes([paths[p][index] for p in seen]))  # type: ignore[misc]
        row: list[int | None] = [None] * len(paths)
        for p, track in zip(seen, ids, strict=True):
            row[p] = int(track)
        result.append(row)
    return result


@given(st.integers(0, 10_000))
def test_people_who_cross_keep_their_numbers(seed: int) -> None:
    random = np.random.default_rng(seed)
    left = [
        (100 + 4 * i + random.normal(0, 1), 300 + random.normal(0, 1), 100.0) for i in range(80)
    ]
    right = [
        (400 - 4 * i + random.normal(0, 1), 312 + random.normal(0, 1), 104.0) for i in range(80)
    ]
    ids = follow([left, right])
    assert len({row[0] for row in ids}) == 1
    assert len({row[1] for row in ids}) == 1


def test_a_walker_behind_a_tree_comes_out_with_the_same_number() -> None:
    path = [(100 + 4.0 * i, 300.0, 100.0) for i in range(90)]
    hidden = [None if 40 <= i < 75 else p for i, p in enumerate(path)]
    ids = follow([hidden])
    assert ids[39][0] == ids[75][0]


def test_someone_elsewhere_is_someone_else() -> None:
    near = [(100.0, 300.0, 100.0)] * 20 + [None] * 20
    far = [None] * 20 + [(500.0, 100.0, 30.0)] * 20
    ids = follow([near, far])
    assert ids[0][0] != ids[39][1]


def test_the_recordings_own_ids_decide() -> None:
    tracker = Tracker(TrackConfig(), "cam")
    first = tracker.update(0, 0, boxes([(100, 300, 100), (120, 300, 100)], ("a", "b")))
    second = tracker.update(FRAME_NS, 1, boxes([(100, 300, 100), (120, 300, 100)], ("b", "a")))
    assert list(second) == list(first[::-1])
    table = tracker.tracks().to_pydict()
    assert table["object_id"] == ["a", "b"]
    assert table["observation_count"] == [2, 2]


def test_flickers_are_no_tracks() -> None:
    tracker = Tracker(TrackConfig(), "cam")
    for index in range(60):
        rows = [(100 + 4.0 * index, 300.0, 100.0)]
        if index % 20 == 0:
            rows.append((500.0, 100.0 + index, 40.0))
        tracker.update(index * FRAME_NS, index, boxes(rows))
    table = tracker.tracks().to_pydict()
    assert table["observation_count"] == [60]
    assert (table["first_frame_index"], table["last_frame_index"]) == ([0], [59])
    assert table["last_time_ns"] == [59 * FRAME_NS]


def test_the_filter_is_the_textbooks() -> None:
    """One coordinate of a constant-height walker: the scalar Kalman recursion, step by step."""
    height, tracker = 100.0, Tracker(TrackConfig(), "cam")
    positions = 100 + 5.0 * np.arange(12) + np.random.default_rng(3).normal(0, 2, 12)
    r, q = (FOOT_STD * height) ** 2, (ACCELERATION_STD * height) ** 2
    state = np.array([positions[0], 0.0])
    covariance = np.diag([r, (SPEED_STD * height) ** 2])
    t = FRAME_NS / 1e9
    move = np.array([[1, t], [0, 1]])
    noise = q * np.array([[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]])
    for index, x in enumerate(positions):
        tracker.update(index * FRAME_NS, index, boxes([(x, 300.0, height)]))
        if index:
            state, covariance = move @ state, move @ covariance @ move.T + noise
            gain = covariance[:, 0] / (covariance[0, 0] + r)
            state = state + gain * (x - state[0])
            covariance = covariance - np.outer(gain, covariance[0])
    np.testing.assert_allclose(tracker._filters.state[0, [0, 4]], state, rtol=1e-6)


def test_frames_without_anything_and_clocks_that_jump_back_do_no_harm() -> None:
    tracker = Tracker(TrackConfig(), "cam")
    tracker.update(10 * FRAME_NS, 0, boxes([(100, 300, 100)]))
    assert len(tracker.update(5 * FRAME_NS, 1, Boxes.empty())) == 0
    assert len(tracker.update(6 * FRAME_NS, 2, boxes([(101, 300, 100)]))) == 1


def test_where_a_confirmed_track_must_be_is_known_before_it_is_seen() -> None:
    tracker = Tracker(TrackConfig(), "cam")
    assert len(tracker.expected(0).walked) == 0
    for i in range(20):
        rows = [(100 + 4.0 * i, 300.0, 100.0), (400.0, 200.0, 50.0)]
        tracker.update(i * FRAME_NS, i, boxes(rows[: 1 if i == 19 else 2]))
    tracker.update(20 * FRAME_NS, 20, boxes([(180.0, 300.0, 100.0), (600.0, 250.0, 70.0)]))
    expected = tracker.expected(21 * FRAME_NS)
    # the new one is not confirmed; who was seen last comes first
    assert expected.walked.tolist() == [False, False]
    np.testing.assert_allclose(
        expected.bbox_xyxy_px, [[169, 200, 199, 300], [392.5, 150, 407.5, 200]], atol=1.5
    )


def test_who_has_come_from_elsewhere_has_walked() -> None:
    tracker = Tracker(TrackConfig(), "cam")
    for i in range(60):
        tracker.update(
            i * FRAME_NS, i, boxes([(100 + 4.0 * i, 300.0, 100.0), (400.0, 200.0, 50.0)])
        )
    assert tracker.expected(60 * FRAME_NS).walked.tolist() == [True, False]


def test_a_gate_keeps_a_box_apart_that_no_person_can_reach() -> None:
    # A person of 100 px who stands; then one box 90 px away, 40 ms later: 40 m/s, and no other box.
    still = (300.0, 400.0, 100.0)
    first: list[tuple[float, float, float] | None] = [still] * 20 + [None] * 5
    other: list[tuple[float, float, float] | None] = [None] * 20 + [(390.0, 400.0, 100.0)] * 5
    found = follow([first, other])
    assert {row[0] for row in found[:20]} == {0}
    assert {row[1] for row in found[20:]} == {1}
    # Within what a person can do, it is the same one.
    near: list[tuple[float, float, float] | None] = [None] * 20 + [(304.0, 400.0, 100.0)] * 5
    assert {row[1] for row in follow([first, near])[20:]} == {0}


def test_recorded_ids_that_went_cost_nothing_and_come_again_as_they_were() -> None:
    tracker = Tracker(TrackConfig(), "cam")
    for index in range(3000):
        tracker.update(index * FRAME_NS, index, boxes([(100.0, 200.0, 80.0)], (f"id{index}",)))
        assert len(tracker._active) < 100
    tracks = tracker.tracks()
    assert tracks.num_rows == 3000
    ids = tracker.update(3000 * FRAME_NS, 3000, boxes([(500.0, 300.0, 90.0)], ("id7",)))
    assert ids.tolist() == [7]
    rows = tracker.tracks().to_pylist()
    assert len(rows) == 3000
    assert (rows[7]["first_frame_index"], rows[7]["last_frame_index"]) == (7, 3000)


def test_a_track_is_confirmed_by_its_least_count_of_sightings_and_not_before() -> None:
    tracker = Tracker(TrackConfig(min_count=4), "cam")
    counts = []
    for i in range(5):
        tracker.update(i * FRAME_NS, i, boxes([(100.0, 300.0, 100.0)]))
        counts.append(len(tracker.expected((i + 1) * FRAME_NS).walked))
    assert counts == [0, 0, 0, 1, 1]


def test_to_have_walked_is_to_be_one_own_height_away() -> None:
    for frames, walked in ((46, False), (58, True)):  # 90 and 114 px of a person of 100 px
        tracker = Tracker(TrackConfig(), "cam")
        for i in range(frames):
            tracker.update(i * FRAME_NS, i, boxes([(100 + 2.0 * i, 300.0, 100.0)]))
        assert tracker.expected(frames * FRAME_NS).walked.tolist() == [walked]


def test_tracks_end_where_the_clock_falls_back_by_more_than_they_coast() -> None:
    config = TrackConfig()
    for back_s, same in ((0.5 * config.coast_s, True), (1.5 * config.coast_s, False)):
        tracker = Tracker(config, "cam")
        began_ns = 100_000_000_000
        (first,) = tracker.update(began_ns, 0, boxes([(100.0, 300.0, 100.0)]))
        (again,) = tracker.update(began_ns - int(back_s * 1e9), 1, boxes([(100.0, 300.0, 100.0)]))
        assert bool(again == first) == same
