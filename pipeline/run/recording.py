"""Work on one recording: measure it, estimate it, write its timelines, leave its rows as files.

Each recording is worked in a database of its own, so that whatever happens in it touches no other. The
rows that are left are those to be stored: to take them in is to copy them (`store.parquet.take_rows`).
"""

from __future__ import annotations

import shutil
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import ParamSpec, TypeVar

import pyarrow.parquet as pq

from pipeline.core.config import Config
from pipeline.core.errors import (
    DiskRefused,
    RecordingFailed,
    RowsRefused,
    StadimeterError,
    StoreError,
    Where,
)
from pipeline.core.progress import Progress
from pipeline.core.records import Diagnostic, Severity
from pipeline.core.timing import StageTimes
from pipeline.parallel.processes import WorkerLost, tell
from pipeline.run.pass_one import measure_recording
from pipeline.run.pass_two import estimate_recording
from pipeline.run.refined_tracks import refine_tracks
from pipeline.store.database import Store
from pipeline.store.fingerprint import keep_tables_sha256, stored_tables_sha256
from pipeline.store.parquet import write_rows
from pipeline.store.recordings import RecordingRow, add_diagnostics, replace_recording
from pipeline.store.scratch import Begun, own_store
from pipeline.truth.judge import judge_tracking

# store, recording's id, its file, folder of the timelines, configuration -> files
TimelineWriter = Callable[[Store, str, Path, Path, Config], list[Path]]
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Timelines:
    """Folder of the timelines, and the function that writes those of a recording; both pickle."""

    folder: Path
    write: TimelineWriter


@dataclass(frozen=True, slots=True)
class Work:
    """One recording to be worked, and all that it takes."""

    path: Path
    config: Config
    begun: Begun
    folder: Path  # of its own, beside the database
    timelines: Timelines | None
    threads: int


@dataclass(slots=True)
class Outcome:
    """Result of one recording: it is stored (`recording`), failed (`error`), or its timeline did."""

    path: Path
    recording: RecordingRow | None = None
    timelines: list[Path] = field(default_factory=list)
    error: StadimeterError | None = None
    times: StageTimes = field(default_factory=StageTimes)
    files: dict[str, Path] = field(default_factory=dict)  # of rows, by table
    tables_sha256: str | None = None  # of those rows


def attempt(
    path: Path, task: Callable[P, T], *arguments: P.args, **named: P.kwargs
) -> T | StadimeterError:
    """Do a task of one recording; return any error as an error of this file.

    All work on recordings goes through here, in one process, in several and on a cluster.
    """
    try:
        return task(*arguments, **named)
    except StadimeterError as error:
        return error
    except OSError as error:
        reason = error.strerror or str(error)
        if error.filename is not None and str(error.filename) != str(path):
            return StadimeterError(f"{error.filename}: {reason}", where=Where(path))
        return StadimeterError(f"cannot be read: {reason}", where=Where(path))
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of a library in Rust is no Exception
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}, in {last.name}"
        return RecordingFailed(
            f"an unexpected error: {type(error).__name__}: {error} ({place})",
            where=Where(path),
            remedy="Please report it with this line; other recordings are not affected",
        )


def named(path: Path, error: StadimeterError) -> StadimeterError:
    """Return an error of a database as one of the recording that brought it about."""
    if not isinstance(error, StoreError) or isinstance(error, DiskRefused):
        return error
    if error.where.path == path:
        return error
    return RowsRefused(
        error.problem,
        where=Where(path),
        remedy="Please report it with this line; other recordings are not affected",
    )


def work_alone(work: Work) -> Outcome:
    """Do all of a recording: the task of a process."""
    outcome = Outcome(work.path)
    shutil.rmtree(work.folder, ignore_errors=True)  # by a process that was killed
    found = attempt(work.path, _measured_and_estimated, work, outcome)
    if isinstance(found, StadimeterError):
        return Outcome(work.path, error=named(work.path, found), times=outcome.times)
    return outcome


def _measured_and_estimated(work: Work, outcome: Outcome) -> None:
    parts = work.folder / "parts"
    row = measure_recording(
        work.path, work.config, parts, threads=work.threads, report=tell, times=outcome.times
    )
    finish_measured(work, row, parts, outcome)


def finish_measured(work: Work, row: RecordingRow, parts: Path, outcome: Outcome) -> None:
    """Estimate a recording whose pictures are measured, leave its rows as files, write its timelines.

    Args:
        work: the recording.
        row: its facts.
        parts: folder of what pass 1 left.
        outcome: is completed.
    """
    tell(Progress(work.path.name, "estimate", row.frame_count, 1.0))
    roomy = work.timelines is not None
    with stored_alone(
        row, parts, work.begun, work.config, outcome.times, work.folder, roomy=roomy
    ) as store:
        with outcome.times.stage("store"):
            files = write_rows(store, work.folder, "lz4")
            outcome.tables_sha256 = stored_tables_sha256(store, row.recording_id)
        outcome.recording = row
        outcome.files = {
            t: f for t, f in files.items() if t != "runs" and pq.read_metadata(f).num_rows
        }
        if work.timelines is not None:
            found = attempt(work.path, _timelines, work, work.timelines, store, outcome)
            outcome.error = found if isinstance(found, StadimeterError) else None


@contextmanager
def stored_alone(
    row: RecordingRow,
    parts: Path,
    begun: Begun,
    config: Config,
    times: StageTimes,
    folder: Path | None = None,
    *,
    roomy: bool = False,
) -> Iterator[Store]:
    """Give a database of its own that holds one recording whole: measured, and estimated.

    Args:
        row: the recording.
        parts: folder of what pass 1 measured.
        begun: the run.
        config: how to estimate.
        times: is added to.
        folder: where the database lies meanwhile.
        roomy: true if much is read from it at once, as timelines do.
    """
    with times.stage("refine tracks"):
        refine_tracks(parts, config.track)
    with own_store(begun, folder, roomy=roomy) as store:
        with store.transaction():
            with times.stage("store"):
                recording_id = replace_recording(store, row, parts, begun.run_id)
            with times.stage("estimate"):
                estimate_recording(store, recording_id, begun.run_id, row.path.name, config)
                judge_tracking(store, recording_id)
            with times.stage("store"):
                keep_tables_sha256(store, recording_id, begun.run_id)
        yield store


def _timelines(work: Work, timelines: Timelines, store: Store, outcome: Outcome) -> None:
    """Write the Rerun recordings of a stored recording; a long one is split by time."""
    row = outcome.recording
    assert row is not None  # noqa: S101  (narrowing)
    tell(Progress(work.path.name, "timeline", row.frame_count, 1.0))
    with outcome.times.stage("timeline"):
        outcome.timelines = timelines.write(
            store, row.recording_id, work.path, timelines.folder, work.config
        )


def add_failure(
    store: Store,
    path: Path,
    error: StadimeterError,
    run_id: str,
    recording_id: str | None = None,
    code_of_stored: str = "timeline_failed",
) -> None:
    """Commit the reason why there is nothing of a recording, or no timeline of a stored one."""
    refused = isinstance(error, RecordingFailed | StoreError | WorkerLost)
    code = "recording_failed" if refused else "unreadable_file"
    if recording_id is not None:
        code = code_of_stored
    note = Diagnostic(Severity.ERROR, code, str(error))
    with store.transaction():
        add_diagnostics(store, [note], recording_id, run_id, path.name)
