"""Longest part of a recording during which a camera stands still.

Pass 1 tells when a camera has moved or its pictures show another place (`measure.camera_motion`). A pose
that is found from walkers is of one place: it is learned from the longest part between such times, and
used for the tracks that lie in it. A pose that is given counts throughout: a camera on a car keeps its
height and tilt.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.core.records import GroundPlane
from pipeline.estimate.track_batches import Tracks
from pipeline.measure.camera_motion import CUT, MOVED
from pipeline.store.database import Store

# A pose by one of these is not of one place alone.
GIVEN = ("given", "transforms")


def in_standing_part(
    store: Store, recording_id: str, camera: str, tracks: pa.Table
) -> pa.ChunkedArray | pa.Array:
    """Return which tracks, a row each, lie in the longest part between movements of their camera.

    Args:
        store: a database that is open.
        recording_id: which recording.
        camera: which camera of it.
        tracks: the camera's rows of `track_rows.tracks_of`.
    """
    starts = store.connection.sql(
        """
        SELECT DISTINCT (
            SELECT min(frame_index) FROM frames AS f
            WHERE f.recording_id = d.recording_id AND f.camera = d.camera
                AND f.log_time_ns >= d.log_time_ns
        ) AS frame_index
        FROM diagnostics AS d
        WHERE d.recording_id = ? AND d.camera = ? AND d.code IN (?, ?)
        ORDER BY frame_index
        """,
        params=[recording_id, camera, CUT, MOVED],
    ).fetchall()
    begins = [0, *(int(frame) for (frame,) in starts if frame is not None)]
    if len(begins) == 1 or not tracks.num_rows:
        return pa.array(np.ones(tracks.num_rows, dtype=np.bool_))
    ends = [*begins[1:], int(pc.max(tracks["last_frame_index"]).as_py()) + 1]
    longest = int(np.argmax(np.subtract(ends, begins)))
    return pc.and_(
        pc.greater_equal(tracks["first_frame_index"], begins[longest]),
        pc.less(tracks["last_frame_index"], ends[longest]),
    )


def parts_of(
    tracks: pa.Table, stands: pa.ChunkedArray | pa.Array, plane: GroundPlane | None
) -> list[tuple[Tracks, GroundPlane | None]]:
    """Return tracks with the pose that is theirs: none outside of the part that a pose was found in."""
    if plane is None or plane.source in GIVEN or pc.all(stands).as_py():
        return [(Tracks.of(tracks), plane)]
    parts = [(tracks.filter(stands), plane), (tracks.filter(pc.invert(stands)), None)]
    return [(Tracks.of(some), theirs) for some, theirs in parts if some.num_rows]
