"""Tables of a recording: their names, the order of their rows, and their columns as they are stored."""

from __future__ import annotations

import pyarrow as pa

from pipeline.core.tables import PASS_ONE, PASS_TWO
from pipeline.store.precision import kept

# Tables with rows of a recording; deleting these rows forgets the recording.
RECORDING_TABLES = (
    "recordings",
    *PASS_ONE,
    "matches",
    "labelled_frames",
    "ignore_regions",
    "tracking_accuracy",
    "estimates",
    "track_heights",
    "observation_quality",
    "track_cadences",
)
# Tables with rows of files of truth too, which stay when a recording is measured again.
TRUTH_TABLES = ("ground_truth", "labelled_frames", "ignore_regions")
# Tables of pass 2 with rows of a recording and a run.
ESTIMATE_TABLES = ("estimates", "track_heights", "observation_quality", "track_cadences")
# Order of rows as they go in, so that a recording's, a camera's and a time's lie together.
ROW_ORDER = {
    "frames": "camera, frame_index",
    "tracks": "camera, track_id",
    "background_lines": "camera, x0_px, y0_px",
    "observations": "camera, frame_index, observation_index",
    "ground_truth": "camera, frame_index, object_id",
    "estimates": "method, observation_index",
    "track_heights": "method, camera, track_id",
    "observation_quality": "observation_index",
    "track_cadences": "camera, track_id",
}


def stored_columns(table: str) -> str:
    """Return SQL for the columns of a table that comes in.

    NaN becomes NULL, in tables of pass 2 infinity too; numbers are rounded to the decimals that are kept.
    """
    test = "isfinite({0})" if table in PASS_TWO else "NOT isnan({0})"
    return ", ".join(
        f"CASE WHEN {test.format(c.name)} THEN {kept(table, c.name, c.name)} END AS {c.name}"
        if pa.types.is_floating(c.type)
        else c.name
        for c in (PASS_ONE | PASS_TWO)[table]
    )
