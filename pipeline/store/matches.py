"""Filling the table `matches`, some frames at a time: a day needs the memory of these."""

from __future__ import annotations

from pipeline.store.database import Store

STRETCH = 20_000  # frames


def add_matches(store: Store, recording_id: str, stretch: int = STRETCH) -> None:
    """Match the observations of a recording with its truth; inside a transaction."""
    span = store.connection.execute(
        "SELECT min(frame_index), max(frame_index) FROM ground_truth WHERE recording_id = ?",
        [recording_id],
    ).fetchone()
    if span is None or span[0] is None:
        return
    for first in range(span[0], span[1] + 1, stretch):
        store.connection.execute(
            "INSERT INTO matches BY NAME FROM "
            "accuracy.match_candidates(?, first_frame := ?, last_frame := ?)",
            [recording_id, first, first + stretch - 1],
        )
