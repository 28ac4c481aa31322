"""Recordings that hold the same evidence as one that is stored: it is counted once, and told.

The same bytes have the same key wherever they lie, so the one replaces the other. A recording that was
read while it grew is the beginning of the whole one; its hash says so. Frames that two recordings hold
stay in both; the view `repeated_frames` tells which do not count.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.core.errors import RowsRefused, Where
from pipeline.core.records import Diagnostic, Severity
from pipeline.run.truth import match_again
from pipeline.store.database import Store
from pipeline.store.forget import forget
from pipeline.store.kept import drop_all_kept
from pipeline.store.parquet import take_rows
from pipeline.store.recordings import (
    RecordingRow,
    add_diagnostics,
    has_truth_of_files,
    refuse_collision,
)

_BLOCK = 1 << 20
_CODE = "overlapping_recordings"
_REPEATED = """
SELECT
    recording_id, later.file_name, later.run_id, first.file_name AS first_name, count(*) AS frames
FROM main.repeated_frames
JOIN recordings later USING (recording_id)
JOIN recordings first ON first.recording_id = first_recording_id
WHERE list_contains($of, recording_id) OR list_contains($of, first_recording_id)
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
        elif _begins_with(Path(path), size, row):
            found.whole = path
    return found


def take_once(store: Store, row: RecordingRow, files: Mapping[str, Path], run_id: str) -> None:
    """Take a recording's rows in, in place of those that it holds as well; call inside a transaction.

    Raises:
        RowsRefused: it is the beginning of one that is stored whole, or its key is taken.
    """
    refuse_collision(store, row)
    same = same_as_stored(store, row)
    if same.whole:
        raise RowsRefused(
            f"is only the beginning of {same.whole}, which is stored whole", where=Where(row.path)
        )
    for replaced in same.replaced:
        forget(store, replaced)
        drop_all_kept(store, replaced)
    take_rows(store, row.recording_id, files)
    if has_truth_of_files(store, row.recording_id):
        match_again(store, row.recording_id)
    if same.notes:
        add_diagnostics(store, same.notes, row.recording_id, run_id, row.path.name)


def tell_repeated_frames(
    store: Store, recording_ids: Collection[str], run_id: str | None = None
) -> None:
    """Note at each recording which of its frames another one holds too, in place of older notes.

    It asks when all are stored: whichever was finished first makes no difference.

    Args:
        store: the database.
        recording_ids: recordings that are new in it.
        run_id: the run that says so; None takes the run of each recording.
    """
    found = repeated_frames(store, recording_ids)
    if not found:
        return
    with store.transaction():
        for recording_id in {one.recording_id for one in found}:
            store.connection.execute(
                "DELETE FROM diagnostics WHERE recording_id = ? AND code = ?",
                [recording_id, _CODE],
            )
        for one in found:
            add_diagnostics(
                store, [one.note], one.recording_id, run_id or one.run_id, one.file_name
            )


@dataclass(frozen=True, slots=True)
class Repeated:
    """Frames of a recording that another one, which began earlier, holds too."""

    recording_id: str
    file_name: str
    run_id: str
    first_name: str
    count: int

    @property
    def note(self) -> Diagnostic:
        """Warning about them."""
        text = (
            f"{self.count:,} frames are also in {self.first_name}, which began earlier; they count "
            "there and not here in people, places, current_estimates and what accuracy adds up"
        )
        return Diagnostic(Severity.WARNING, _CODE, text, count=self.count)


def repeated_frames(store: Store, recording_ids: Collection[str]) -> list[Repeated]:
    """Return, by recording, the repeated frames that these recordings have or bring about."""
    rows = store.connection.execute(_REPEATED, {"of": list(recording_ids)}).fetchall()
    return [Repeated(*row) for row in rows]


def _begins_with(path: Path, size: int, row: RecordingRow) -> bool:
    """Return true if a file, as it was stored, begins with a new recording.

    A shorter file under the same path has taken its place, and is no beginning of what is gone.
    """
    try:
        is_it_still = path.stat().st_size == size and not path.samefile(row.path)
    except OSError:
        return False
    return is_it_still and _hash_of_beginning(path, row.size_bytes) == row.content_sha256


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
