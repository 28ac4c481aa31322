"""Recordings in and out: the rows of pass 1, cameras and diagnostics.

A recording is replaced whole inside one transaction.
"""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from pipeline.core.camera_row import CameraRow
from pipeline.core.diagnostics import diagnostics_table
from pipeline.core.errors import RowsRefused, Where
from pipeline.core.records import Diagnostic, GroundPlane
from pipeline.core.tables import PASS_ONE
from pipeline.core.text import storable
from pipeline.store.columns import ROW_ORDER, stored_columns
from pipeline.store.database import Store, read_once
from pipeline.store.forget import forget
from pipeline.store.matches import add_matches
from pipeline.store.parquet_parts import read_part

_LENS_COLUMNS = (
    "fx_px",
    "fy_px",
    "cx_px",
    "cy_px",
    "focal_std_px",
    "distortion_model",
    "distortion",
    "intrinsics_source",
    "centre_source",
    "distortion_source",
)
# Observations of the tracks that lasted, of the class that their track was found to have.
_JUDGED = """
SELECT o.* REPLACE (
    CASE WHEN t.verdict IS NOT NULL AND t.class_name = 'unknown' THEN 'unknown'
    ELSE o.class_name END AS class_name
)
FROM ({source}) AS o JOIN (
    SELECT camera, track_id, class_name, verdict FROM tracks WHERE recording_id = ?
) AS t USING (camera, track_id)
"""


@dataclass(frozen=True, slots=True)
class RecordingRow:
    """A recording as it is known after pass 1."""

    path: Path
    content_sha256: str
    size_bytes: int
    start_time_ns: int | None
    end_time_ns: int | None
    frame_count: int
    frames_lost: int
    damaged: bool

    @property
    def recording_id(self) -> str:
        """The key: the same bytes under another name are the same recording."""
        return self.content_sha256[:16]


def list_recordings(store: Store) -> pa.Table:
    """Return the rows of all recordings, by file name."""
    return store.connection.sql("FROM recordings ORDER BY file_name").to_arrow_table()


def replace_recording(store: Store, recording: RecordingRow, parts: Path, run_id: str) -> str:
    """Replace a recording by the parts that pass 1 wrote; call inside a transaction.

    Observations of tracks that did not last (they are not in the part `tracks`) are noise of the
    detector and are left out. Returns the recording's id.

    Raises:
        RowsRefused: a part is missing, or the recording's key is taken by another one.
    """
    recording_id = recording.recording_id
    refuse_collision(store, recording)
    forget(store, recording_id)
    store.connection.execute(
        "INSERT INTO recordings BY NAME SELECT ? AS recording_id, ? AS content_sha256, "
        "? AS file_name, ? AS path, ? AS size_bytes, ? AS start_time_ns, ? AS end_time_ns, "
        "? AS frame_count, ? AS frames_lost, ? AS damaged, ? AS run_id",
        [
            recording_id,
            recording.content_sha256,
            storable(recording.path.name),
            storable(str(recording.path)),
            recording.size_bytes,
            recording.start_time_ns,
            recording.end_time_ns,
            recording.frame_count,
            recording.frames_lost,
            recording.damaged,
            run_id,
        ],
    )
    for table in PASS_ONE:
        _insert_part(store, table, parts, recording, run_id)
    add_matches(store, recording_id)
    return recording_id


def has_truth_of_files(store: Store, recording_id: str) -> bool:
    """Return true if truth of a recording was read from a file."""
    found = store.connection.execute(
        "SELECT 1 FROM labelled_frames WHERE recording_id = ? LIMIT 1", [recording_id]
    ).fetchall()
    return bool(found)


def refuse_collision(store: Store, recording: RecordingRow) -> None:
    """Refuse a recording whose key another one has.

    Raises:
        RowsRefused: there is such a one.
    """
    other = store.connection.execute(
        "SELECT path FROM recordings WHERE recording_id = ? AND content_sha256 <> ?",
        [recording.recording_id, recording.content_sha256],
    ).fetchone()
    if other is not None:
        raise RowsRefused(
            f"its key {recording.recording_id} is taken by another recording, {other[0]}",
            where=Where(recording.path),
            remedy="Use another database for it",
        )


def has_run_of(store: Store, recording_id: str, run_id: str) -> bool:
    """Return true if a run measured a recording, and its rows are there: current, or kept beside."""
    found = store.connection.execute(
        "SELECT 1 FROM recordings WHERE recording_id = $1 AND run_id = $2 "
        "UNION ALL SELECT 1 FROM kept_runs WHERE recording_id = $1 AND measured_by = $2",
        [recording_id, run_id],
    ).fetchone()
    return found is not None


def has_failure_of(store: Store, file_name: str, run_id: str) -> bool:
    """Return true if a run has said that a file is no recording."""
    found = store.connection.execute(
        "SELECT 1 FROM diagnostics WHERE recording_id IS NULL AND file_name = ? AND run_id = ?",
        [storable(file_name), run_id],
    ).fetchone()
    return found is not None


def set_pose(store: Store, recording_id: str, camera: str, plane: GroundPlane) -> None:
    """Store the pose of a camera; call inside a transaction."""
    std = plane.covariance.diagonal() ** 0.5
    store.connection.execute(
        "UPDATE cameras SET camera_height_m = ?, camera_height_std_m = ?, tilt_rad = ?, "
        "tilt_std_rad = ?, roll_rad = ?, roll_std_rad = ?, pose_source = ?, pose_loadings = ? "
        "WHERE recording_id = ? AND camera = ?",
        [
            plane.camera_height_m,
            float(std[0]),
            plane.tilt_rad,
            float(std[1]),
            plane.roll_rad,
            float(std[2]),
            plane.source,
            None if plane.joint is None else plane.joint.low_rank[:3].ravel().tolist(),
            recording_id,
            camera,
        ],
    )


def set_lens(store: Store, recording_id: str, row: CameraRow) -> None:
    """Store the lens of a camera; call inside a transaction."""
    values = ", ".join(f"{name} = ?" for name in _LENS_COLUMNS)
    store.connection.execute(
        f"UPDATE cameras SET {values} WHERE recording_id = ? AND camera = ?",
        [*(getattr(row, name) for name in _LENS_COLUMNS), recording_id, row.camera],
    )


def add_diagnostics(
    store: Store,
    notes: Sequence[Diagnostic],
    recording_id: str | None,
    run_id: str,
    file_name: str,
) -> None:
    """Add diagnostics, of a recording or of a file that is none; call inside a transaction."""
    with store.incoming("incoming", diagnostics_table(list(notes))):
        store.connection.execute(
            "INSERT INTO diagnostics BY NAME "
            "SELECT ? AS recording_id, ? AS run_id, ? AS file_name, * FROM incoming",
            [recording_id, run_id, storable(file_name)],
        )


def _insert_part(
    store: Store, table: str, parts: Path, recording: RecordingRow, run_id: str
) -> None:
    recording_id = recording.recording_id
    source = f"SELECT ? AS recording_id, {stored_columns(table)} FROM part"
    values = [recording_id]
    if table == "diagnostics":
        source = f"SELECT ? AS run_id, ? AS file_name, * FROM ({source})"
        values = [run_id, storable(recording.path.name), recording_id]
    if table == "observations":
        source = _JUDGED.format(source=source)
        values.append(recording_id)
    # They come by time already: to sort some at a time is enough, and needs the memory of some.
    if table in ROW_ORDER:
        source += f" ORDER BY {ROW_ORDER[table]}"
    for rows in read_part(parts, table):
        with store.incoming("part", read_once(rows)):
            store.connection.execute(f"INSERT INTO {table} BY NAME {source}", values)
