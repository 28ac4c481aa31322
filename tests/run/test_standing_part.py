"""Choice of the part of a recording in which a camera stands still."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest

from pipeline.core.records import GroundPlane
from pipeline.run.standing_part import in_standing_part, parts_of

TRACKS = pa.table(
    {
        "track_id": [1, 2, 3, 4, 5],
        "first_frame_index": [0, 15, 25, 50, 92],
        "last_frame_index": [18, 22, 80, 89, 99],
        "observation_count": [19, 8, 56, 40, 8],
    }
)
POSE = GroundPlane(5.0, 0.3, 0.0, np.eye(3), "walkers")


def stored(*events: tuple[str, int, str]) -> Any:
    """Return a store of 100 frames, a tenth of a second apart, and diagnostics: code, frame, camera."""
    connection = duckdb.connect()
    connection.sql(
        "CREATE TABLE frames AS SELECT 'r' AS recording_id, 'mast' AS camera, i AS frame_index, "
        "i * 100 AS log_time_ns FROM range(100) AS t(i)"
    )
    connection.sql(
        "CREATE TABLE diagnostics "
        "(recording_id VARCHAR, camera VARCHAR, code VARCHAR, log_time_ns BIGINT)"
    )
    for code, frame, camera in events:
        values = ["r", camera, code, frame * 100 - 50]
        connection.execute("INSERT INTO diagnostics VALUES (?, ?, ?, ?)", values)
    return SimpleNamespace(connection=connection)


def chosen(*events: tuple[str, int, str]) -> list[int]:
    stands = in_standing_part(stored(*events), "r", "mast", TRACKS)
    kept: list[int] = TRACKS.filter(stands)["track_id"].to_pylist()
    return kept


def test_all_of_a_camera_that_stands() -> None:
    assert chosen() == [1, 2, 3, 4, 5]
    assert chosen(("camera_cut", 20, "other"), ("invalid_value", 20, "mast")) == [1, 2, 3, 4, 5]


def test_the_longest_part_without_who_is_seen_across_its_ends() -> None:
    assert chosen(("camera_cut", 20, "mast")) == [3, 4, 5]
    assert chosen(("camera_cut", 20, "mast"), ("moving_camera", 90, "mast")) == [3, 4]
    assert chosen(("camera_cut", 85, "mast")) == [1, 2, 3]


def test_a_pose_found_is_not_used_beyond_its_part() -> None:
    stands = in_standing_part(stored(("camera_cut", 20, "mast")), "r", "mast", TRACKS)
    (inside, plane), (outside, none) = parts_of(TRACKS, stands, POSE)
    assert plane is POSE
    assert none is None
    assert inside.track_id.tolist() == [3, 4, 5]
    assert outside.track_id.tolist() == [1, 2]


@pytest.mark.parametrize("source", ["given", "transforms"])
def test_a_pose_given_is_used_throughout(source: str) -> None:
    stands = in_standing_part(stored(("camera_cut", 20, "mast")), "r", "mast", TRACKS)
    plane = GroundPlane(5.0, 0.3, source=source)
    ((all_of_them, used),) = parts_of(TRACKS, stands, plane)
    assert used is plane
    assert len(all_of_them) == TRACKS.num_rows
    assert pc.sum(stands).as_py() == 3
