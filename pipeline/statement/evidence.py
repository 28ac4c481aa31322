"""Stored rows that one person's height and distances rest on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.core.camera_row import CameraRow, camera_rows
from pipeline.core.config import Config
from pipeline.core.errors import UsageError
from pipeline.core.records import GroundPlane
from pipeline.mcap_file.bag import found_at
from pipeline.run.verify import config_of
from pipeline.store.database import Store

Row = dict[str, Any]

_TRACKS = """
SELECT recording_id, file_name, camera FROM tracks JOIN recordings USING (recording_id)
WHERE track_id = $track AND ($recording IS NULL OR $recording IN (recording_id, file_name, path))
    AND ($camera IS NULL OR camera = $camera)
ORDER BY file_name, camera
"""
_HEIGHT = """
FROM track_heights SEMI JOIN main.current_run USING (recording_id, run_id)
WHERE recording_id = $recording AND camera = $camera AND track_id = $track AND method = 'fused'
"""
_FRAMES = """
SELECT
    e.frame_index, e.capture_time_ns, f.log_time_ns, e.depth_m, e.depth_low_m, e.depth_high_m, e.range_m,
    e.height_m, e.height_low_m, e.height_high_m, e.height_assumed, o.x_min_px, o.y_min_px,
    o.x_max_px, o.y_max_px, coalesce(o.occlusion, 0) AS occlusion, coalesce(o.measured, true) AS measured,
    o.truncated_left OR o.truncated_top OR o.truncated_right OR o.truncated_bottom AS truncated
FROM recording_estimates AS e
JOIN observations AS o USING (recording_id, observation_index)
JOIN frames AS f ON f.recording_id = e.recording_id AND f.camera = e.camera
    AND f.frame_index = e.frame_index
WHERE e.recording_id = $recording AND e.camera = $camera AND e.track_id = $track
    AND e.method = 'fused'
ORDER BY e.frame_index
"""
_NOTES = """
SELECT severity, code, message, sum(count)::BIGINT AS count FROM diagnostics
WHERE recording_id = $recording AND (camera IS NULL OR camera = $camera)
    AND (severity <> 'info' OR code IN (
        'scale_from_statures', 'scale_from_known_lengths', 'tilt_from_people', 'pose_from_walkers',
        'class_renamed'
    ))
GROUP BY severity, code, message
ORDER BY array_position(['error', 'warning', 'info'], severity), code
"""
_DIFFERENCE = """
SELECT height_difference(a, b) AS difference, taller(a, b) AS taller
FROM recording_people AS a, recording_people AS b
WHERE a.recording_id = $recording AND a.camera = $camera AND a.track_id = $track
    AND b.recording_id = $recording AND b.camera = $camera AND b.track_id = $other
"""


@dataclass(frozen=True, slots=True)
class Subject:
    """One track of one camera of one recording."""

    recording_id: str
    camera: str
    track_id: int

    @property
    def values(self) -> dict[str, object]:
        """Its key as the parameters of a query."""
        return {
            "recording": self.recording_id,
            "camera": self.camera,
            "track": self.track_id,
        }


@dataclass(frozen=True, slots=True)
class Evidence:
    """Stored rows about a subject; `height` is None if it has none by the best method."""

    subject: Subject
    file: Path | None  # the recording, if it is found where it was, or beside the database
    recording: Row
    camera: CameraRow
    pose: Row  # its row of the table `cameras`
    run: Row
    config: Config
    class_name: str
    height: Row | None
    frames: tuple[Row, ...]
    notes: tuple[Row, ...]

    @property
    def plane(self) -> GroundPlane | None:
        """The pose that was used, with the covariance that is stored of it."""
        row = self.pose
        if row["camera_height_m"] is None:
            return None
        return GroundPlane(
            row["camera_height_m"],
            row["tilt_rad"],
            row["roll_rad"] or 0.0,
            pose_covariance(row),
            row["pose_source"] or "given",
        )


def pose_covariance(row: Row) -> np.ndarray:
    """Return the covariance of (camera height, tilt, roll), (3, 3), by a row of the table `cameras`."""
    std = [
        row[f"{name}"] or 0.0 for name in ("camera_height_std_m", "tilt_std_rad", "roll_std_rad")
    ]
    if row["pose_loadings"] is None:
        return np.diag(np.square(std))
    loadings = np.asarray(row["pose_loadings"], dtype=np.float64).reshape(3, -1)
    loadings = np.diag([row["camera_height_m"], 1.0, 1.0]) @ loadings
    return np.asarray(loadings @ loadings.T)


def find_subject(
    store: Store, track_id: int, recording: str | None = None, camera: str | None = None
) -> Subject:
    """Return the track that is meant.

    Args:
        store: a database that is open.
        track_id: its number.
        recording: file name, path or id, where the number is there in several.
        camera: name of its camera, likewise.

    Raises:
        UsageError: there is no such track, or there are several.
    """
    values = {"track": track_id, "recording": recording, "camera": camera}
    found = store.query(_TRACKS, values).to_pylist()
    if not found:
        raise UsageError(
            f"there is no track {track_id}{f' of {recording}' if recording else ''}",
            remedy="`stadimeter query --view people` lists tracks with their heights",
        )
    if len(found) > 1:
        places = ", ".join(f"{r['file_name']} (camera {r['camera']})" for r in found[:10])
        raise UsageError(
            f"track {track_id} is there {len(found)} times: {places}",
            remedy="Choose with --recording and --camera",
        )
    return Subject(found[0]["recording_id"], found[0]["camera"], track_id)


def read_evidence(store: Store, subject: Subject) -> Evidence:
    """Return what is stored of a track by the run that counts."""
    values = subject.values
    by_recording = {"recording": subject.recording_id}
    recording = _only(store, "FROM recordings WHERE recording_id = $recording", by_recording)
    run = _only(
        store,
        "FROM runs SEMI JOIN main.current_run USING (run_id) WHERE run_id IN "
        "(SELECT run_id FROM main.current_run WHERE recording_id = $recording)",
        by_recording,
    )
    cameras = store.read("cameras", subject.recording_id)
    pose = next(r for r in cameras.to_pylist() if r["camera"] == subject.camera)
    row = next(r for r in camera_rows(cameras) if r.camera == subject.camera)
    track = _only(
        store,
        "FROM tracks WHERE recording_id = $recording AND camera = $camera AND track_id = $track",
        values,
    )
    heights = store.query(_HEIGHT, values).to_pylist()
    scope = {name: values[name] for name in ("recording", "camera")}
    return Evidence(
        subject,
        found_at(Path(recording["path"]), store.path.parent),
        recording,
        row,
        pose,
        run,
        config_of(store, run["run_id"]).naming(row.camera, row.topic),
        track["class_name"],
        heights[0] if heights else None,
        tuple(store.query(_FRAMES, values).to_pylist()),
        tuple(store.query(_NOTES, scope).to_pylist()),
    )


def difference(store: Store, subject: Subject, other: int) -> tuple[Row, float]:
    """Return the difference of two heights with its interval, and the probability of being taller.

    Both are measured by one camera, so that what they have in common cancels.

    Raises:
        UsageError: the other track has no measured height in this recording and camera.
    """
    rows = store.query(_DIFFERENCE, subject.values | {"other": other}).to_pylist()
    if not rows or rows[0]["difference"] is None or rows[0]["difference"]["value_m"] is None:
        raise UsageError(
            f"tracks {subject.track_id} and {other} have no heights of one camera to compare",
            remedy="`stadimeter query --view people` lists the tracks whose height was measured",
        )
    return rows[0]["difference"], float(rows[0]["taller"])


def half_width_cm(share: float | None, std_m: float) -> float:
    """Return the half-width of 95 % in cm that a share of a variance makes by itself."""
    return 196.0 * std_m * math.sqrt(max(share or 0.0, 0.0))


def _only(store: Store, sql: str, values: Mapping[str, object]) -> Row:
    row: Row = store.query(sql, values).to_pylist()[0]
    return row
