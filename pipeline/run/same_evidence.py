"""Recordings that hold the same evidence as one that is stored: it is counted once, and told.

The same bytes have the same key wherever they lie, so the one replaces the other. A recording that was
read while it grew is the beginning of the whole one; its hash says so.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.core.records import Diagnostic, Severity
from pipeline.store.database import Store
from pipeline.store.recordings import RecordingRow

_BLOCK = 1 << 20
# Stored frames are the same as new ones if camera, times, bytes and light are equal.
_OVERLAPS = """
WITH mine AS (FROM frames WHERE recording_id = $recording),
at_that_time AS (
    SELECT o.recording_id FROM recordings o JOIN recordings n ON n.recording_id = $recording
    WHERE o.recording_id <> $recording
        AND o.start_time_ns <= n.end_time_ns AND o.end_time_ns >= n.start_time_ns
)
SELECT r.recording_id, r.file_name, count(*) AS frames
FROM mine
JOIN (FROM frames SEMI JOIN at_that_time USING (recording_id)) f
    USING (camera, log_time_ns, capture_time_ns, image_bytes)
JOIN recordings r ON r.recording_id = f.recording_id
WHERE f.luminance IS NOT DISTINCT FROM mine.luminance
GROUP BY ALL ORDER BY ALL
"""


@dataclass(slots=True)
class Same:
    """Stored recordings that a new one holds as well, and what is to be told."""

    replaced: list[str] = field(default_factory=list)  # their ids: the new one goes on from them
    notes: list[Diagnostic] = field(default_factory=list)
    whole: str = ""  # file of a stored recording of which the new one is only the beginning


def same_as_stored(store: Store, row: RecordingRow) -> Same:
    """Return what is stored already of a new recording, by the hashes of files."""
    found = Same()
    others = store.connection.execute(
        "SELECT recording_id, path, size_bytes, content_sha256 FROM recordings "
        "WHERE recording_id = ? OR start_time_ns IS NOT DISTINCT FROM ?",
        [row.recording_id, row.start_time_ns],
    ).fetchall()
    for key, path, size, sha256 in others:
        if sha256 == row.content_sha256:
            if Path(path) != row.path and Path(path).absolute() != row.path.absolute():
                text = f"the same bytes were stored before, from {path}; they count once"
                found.notes.append(Diagnostic(Severity.WARNING, "same_content", text))
        elif size < row.size_bytes:
            if _hash_of_beginning(row.path, size) == sha256:
                found.replaced.append(key)
                text = (
                    f"the first {size:,} bytes were stored before, from {path}, when the file was "
                )
                text += "shorter; this recording replaces them"
                found.notes.append(Diagnostic(Severity.WARNING, "replaced_beginning", text))
        elif _hash_of_beginning(Path(path), row.size_bytes) == row.content_sha256:
            found.whole = path
    return found


def overlaps(store: Store, recording_id: str, later: Collection[str]) -> list[Diagnostic]:
    """Return a warning for each stored recording with the same frames as a new one.

    Args:
        store: the database.
        recording_id: the new one.
        later: recordings that tell it of themselves.
    """
    rows = store.connection.execute(_OVERLAPS, {"recording": recording_id}).fetchall()
    return [
        Diagnostic(
            Severity.WARNING,
            "overlapping_recordings",
            f"{count:,} frames are also in {name}: what is counted over both recordings counts them "
            "twice; leave one of the files out",
            count=count,
        )
        for key, name, count in rows
        if key not in later
    ]


def _hash_of_beginning(path: Path, size: int) -> str | None:
    """Return the hash of so many bytes at the beginning of a file; None if it has not so many."""
    digest, left = hashlib.sha256(), size
    try:
        with path.open("rb") as stream:
            while left and (block := stream.read(min(_BLOCK, left))):
                digest.update(block)
                left -= len(block)
    except OSError:
        return None
    return None if left else digest.hexdigest()
