"""Verdicts on tracks: by a network that looked, by speed alone, and none."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.config import TrackConfig
from pipeline.track.verdict import FASTEST, TrackSums, tracks_table

RATE = 10


def sums(step_px: float, confirmed: list[float], stretches: int = 1, count: int = 40) -> TrackSums:
    """Return the sums of one track, 100 px tall, that goes so far each frame."""
    found = TrackSums()
    frame = np.arange(count)
    x = step_px * frame
    box = np.stack([x, np.full(count, 100.0), x + 30, np.full(count, 200.0)], axis=1)
    looks = np.full(count, np.nan)
    looks[5 : 5 + len(confirmed)] = confirmed
    for rows in np.array_split(frame, stretches):
        found.add(
            np.zeros(len(rows), dtype=int),
            rows,
            rows * 1_000_000_000 // RATE,
            box[rows],
            ["person"] * len(rows),
            np.ones(len(rows), dtype=bool),
            looks[rows],
        )
    return found


@pytest.mark.parametrize("stretches", [1, 3])
@pytest.mark.parametrize(
    ("speed", "looks", "verdict", "class_name"),
    [
        (0.8, [], "undecided", "person"),
        (0.0, [], "undecided", "person"),  # who stands is a person too
        (1.5 * FASTEST, [], "implausible", "unknown"),
        (0.8, [1, 1, 0, 1], "confirmed", "person"),
        (0.8, [0], "refused", "unknown"),
        (0.8, [0, 0, 1, 0, 0, 0], "refused", "unknown"),
        (1.5 * FASTEST, [1, 1, 1], "confirmed", "person"),  # the clock is wrong, not the network
    ],
)
def test_verdicts(
    speed: float, looks: list[float], verdict: str, class_name: str, stretches: int
) -> None:
    track = sums(speed * 100 / RATE, looks, stretches)
    (row,) = tracks_table("cam", track, TrackConfig(), judged=True).to_pylist()
    assert (row["verdict"], row["class_name"]) == (verdict, class_name)
    assert row["observation_count"] == 40
    assert row["looked_at_count"] == (len(looks) or None)
    assert (row["first_frame_index"], row["last_frame_index"]) == (0, 39)


def test_where_a_network_looks_who_was_never_seen_whole_is_not_taken_for_a_person() -> None:
    both, other = sums(8, [1, 1]), sums(8, [])
    other._parts[0]["track_id"] = 1
    both._parts += other._parts
    table = tracks_table("cam", both, TrackConfig(), judged=True).to_pylist()
    assert [(r["verdict"], r["class_name"]) for r in table] == [
        ("confirmed", "person"),
        ("undecided", "unknown"),
    ]


def test_noise_is_no_track_and_a_detectors_own_word_stands() -> None:
    assert tracks_table("cam", sums(8, [], count=4), TrackConfig(), judged=True).num_rows == 0
    (row,) = tracks_table("cam", sums(90, []), TrackConfig(), judged=False).to_pylist()
    assert (row["verdict"], row["class_name"]) == (None, "person")
