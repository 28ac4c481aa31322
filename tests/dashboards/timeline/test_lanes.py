"""States of tracks, and the worst errors, from rows made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from dashboards.timeline.columns import CameraRows, camera_rows
from dashboards.timeline.error_curves import APART_FRAMES, WORST, errors_of, worst_errors
from dashboards.timeline.lanes import HIDDEN, PREDICTED, SEEN, _covered, track_states
from pipeline.core.tables import CAMERAS, ESTIMATES, FRAMES, GROUND_TRUTH, OBSERVATIONS

END = -1
FRAME_COUNT = 60


def table(schema: pa.Schema, rows: list[dict[str, Any]]) -> pa.Table:
    whole = [{name: row.get(name) for name in schema.names} for row in rows]
    return pa.Table.from_pylist(whole, schema=schema)


def rows_of(
    seen: list[tuple[int, int, bool]], depths: list[tuple[float, float]] | None = None
) -> CameraRows:
    """Return a camera with observations: frame, track and whether its feet can be seen."""
    camera = {"camera": "c", "width_px": 640, "height_px": 480}
    frames = [
        {
            "camera": "c",
            "frame_index": i,
            "log_time_ns": i,
            "capture_time_ns": i,
            "decoded": True,
        }
        for i in range(FRAME_COUNT)
    ]
    observations = [
        {"observation_index": n, "camera": "c", "frame_index": frame, "track_id": track}
        | {"x_min_px": 0.0, "y_min_px": 0.0, "x_max_px": 9.0, "y_max_px": 9.0}
        for n, (frame, track, _) in enumerate(seen)
    ]
    quality = pa.table(
        {
            "observation_index": pa.array(range(len(seen)), pa.int32()),
            "contact_visible": [visible for _, _, visible in seen],
            "head_visible": [None] * len(seen),
        }
    ).cast(
        pa.schema(
            [
                ("observation_index", pa.int32()),
                ("contact_visible", pa.bool_()),
                ("head_visible", pa.bool_()),
            ]
        )
    )
    estimates = [
        {"observation_index": n, "method": "fused", "depth_m": depth, "depth_std_m": 0.1}
        for n, (depth, _) in enumerate(depths or [])
    ]
    matches = pa.table(
        {
            "observation_index": pa.array(range(len(depths or [])), pa.int32()),
            "object_id": [f"o{track}" for _, track, _ in seen[: len(depths or [])]],
            "true_depth_m": pa.array([true for _, true in depths or []], pa.float64()),
            "true_height_m": pa.nulls(len(depths or []), pa.float64()),
        }
    )
    tables = {
        "cameras": table(CAMERAS, [camera]),
        "frames": table(FRAMES, frames),
        "observations": table(OBSERVATIONS, observations),
        "observation_quality": quality,
        "estimates": table(ESTIMATES, estimates),
        "ground_truth": table(GROUND_TRUTH, []),
        "matches": matches,
    }
    return camera_rows(tables["cameras"].to_pylist()[0], tables)


def changes(rows: CameraRows) -> dict[int, list[tuple[int, int]]]:
    found: dict[int, list[tuple[int, int]]] = {}
    row, track, state = track_states(rows)
    for at in np.lexsort((row, track)).tolist():
        found.setdefault(int(rows.tracks.track_id[track[at]]), []).append(
            (int(row[at]), int(state[at]))
        )
    return found


def test_a_track_is_seen_hidden_predicted_and_gone() -> None:
    seen = [(2, 5, True), (3, 5, True), (4, 5, False), (5, 5, False), (9, 5, True)]
    assert changes(rows_of(seen)) == {
        5: [(2, SEEN), (4, HIDDEN), (6, PREDICTED), (9, SEEN), (10, END)]
    }


def test_a_track_in_the_last_frame_does_not_end_and_tracks_stay_apart() -> None:
    last = FRAME_COUNT - 1
    seen = [(0, 1, True), (last - 1, 2, False), (last, 2, False)]
    assert changes(rows_of(seen)) == {1: [(0, SEEN), (1, END)], 2: [(last - 1, HIDDEN)]}


@pytest.mark.parametrize("count", [0, 1])
def test_few_observations_are_no_trouble(count: int) -> None:
    rows = rows_of([(3, 7, True)][:count])
    assert len(changes(rows)) == count


def test_the_worst_are_one_of_each_object_at_a_time() -> None:
    seen = [(frame, track, True) for frame in range(FRAME_COUNT) for track in (1, 2)]
    depths = [(10.0, 10.0)] * len(seen)
    for frame, track, depth in ((20, 1, 15.0), (21, 1, 14.0), (22, 2, 8.0), (50, 1, 12.0)):
        depths[seen.index((frame, track, True))] = (depth, 10.0)
    rows = rows_of(seen, depths)
    worst = worst_errors(rows)
    assert worst is not None
    assert len(worst.observation) <= WORST
    frames = rows.observations.row[worst.observation].tolist()
    errors = dict(zip(frames, worst.error.tolist(), strict=True))
    assert errors == pytest.approx({20: 50.0, 22: -20.0, 50: 20.0})
    assert APART_FRAMES > 21 - 20  # why the second worst is not there


def test_without_truth_there_are_no_errors() -> None:
    rows = rows_of([(1, 1, True)])
    assert worst_errors(rows) is None
    assert errors_of(rows, rows.best) == {}


def test_diagnostics_cover_their_frames() -> None:
    frames = rows_of([]).frames
    notes = [
        {"log_time_ns": 3, "end_time_ns": 5},
        {"log_time_ns": 5, "end_time_ns": None},
        {"log_time_ns": FRAME_COUNT + 9, "end_time_ns": None},
        {"log_time_ns": -4, "end_time_ns": -2},
    ]
    covered = _covered(frames, notes)
    assert np.flatnonzero(covered).tolist() == [0, 3, 4, 5, FRAME_COUNT - 1]
