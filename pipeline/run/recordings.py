"""Recordings through both passes, into the database and onto timelines.

    work each (`recording`: measure -> estimate -> timeline -> rows as files) -> take its rows in

A long one is measured in windows, side by side (`windows.course`); results are the same for any number of
processes.

A recording is committed whole, with its estimates, or not at all. Only this process writes to the
database, because DuckDB lets one in; each recording hands over Parquet files, wherever it was worked.
"""

from __future__ import annotations

import glob
import json
import platform
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.core.config import Config
from pipeline.core.errors import DiskRefused, RowsRefused, StadimeterError, StoreError, Where
from pipeline.core.files import check_folder
from pipeline.core.progress import Progress, Report, silent
from pipeline.importing.provenance import ImportedVideo
from pipeline.parallel.processes import local_engine
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recording import Outcome, Timelines, Work, add_failure, attempt, named
from pipeline.run.recording_paths import folders_apart
from pipeline.run.same_evidence import take_once, tell_repeated_frames
from pipeline.run.windows.course import (
    Course,
    SharedProgress,
    task_count,
    usual_processes,
    windows_of,
)
from pipeline.run.windows.split import WINDOW_S
from pipeline.store.database import Store
from pipeline.store.recordings import list_recordings
from pipeline.store.runs import choose_newest, finish_run, new_run_id, start_run
from pipeline.store.scratch import Begun, empty_database

LIBRARIES = ("numpy", "opencv-python-headless", "duckdb", "pyarrow", "mcap", "rerun-sdk", "scipy")


@dataclass(slots=True)
class RunResult:
    """Outcomes of all recordings of a run, in the order in which they were given."""

    run_id: str
    outcomes: list[Outcome] = field(default_factory=list)
    made: list[ImportedVideo] = field(default_factory=list)  # recordings of videos, for this run

    @property
    def stored(self) -> list[Outcome]:
        """Recordings that are in the database."""
        return [o for o in self.outcomes if o.recording is not None]

    @property
    def failed(self) -> list[Outcome]:
        """Recordings of which nothing was stored, or of which no timeline could be written."""
        return [o for o in self.outcomes if o.error is not None]

    @property
    def damaged(self) -> list[Outcome]:
        """Recordings that were stored with losses."""
        return [o for o in self.outcomes if o.recording is not None and o.recording.damaged]


def run(
    recordings: Iterable[Path],
    database: Path,
    config: Config,
    *,
    timelines: Timelines | None = None,
    workers: int | None = None,
    window_s: float = WINDOW_S,
    label: str | None = None,
    report: Report = silent,
) -> RunResult:
    """Measure, estimate and store recordings; write a timeline of each if it is told how.

    Args:
        recordings: their files.
        database: to store them in; it is made if there is none.
        config: how to work them.
        timelines: folder and writer of timelines, None for none.
        workers: processes at a time; one is this process, None as many as pay, up to one a core. What
            comes out does not depend on it.
        window_s: recordings longer than one and a half times this are cut into windows that are
            measured side by side; 0 leaves all whole.
        label: a name for the run.
        report: is told what is done.

    Raises:
        StoreError: the database cannot be opened or written.
    """
    paths = list(dict.fromkeys(Path(p) for p in recordings))
    new = not database.exists()
    begun = begin(config, label)
    result = RunResult(begun.run_id)
    if timelines is not None:  # told before the work and not after it
        check_folder(timelines.folder, "timelines")
    cut = windows_of(paths, config, window_s)
    processes = min(workers or usual_processes(paths, cut), task_count(paths, cut))
    threads = 1 if processes > 1 else 2
    # A timeline has its recording's name; those of one name go into folders as their recordings do.
    shown_in = folders_apart(paths, timelines.folder) if timelines is not None else {}
    with (
        _held(database, result) as store,
        ThreadPoolExecutor(1) as aside,
        _folder_beside(database) as folder,
        local_engine(processes, SharedProgress(report, cut), [Course.__module__]) as engine,
    ):
        # A new one's tables and views take half a second, which is nobody's to wait for. With one that
        # is there more can go wrong: that is to be known before an hour of footage is measured.
        prepared = aside.submit(_prepare, store, begun)
        if not new:
            prepared.result()
        if processes <= 1:
            aside.submit(empty_database)  # while the first recording is measured
        course = Course(cut, processes)
        for n, path in enumerate(paths):
            shown = timelines and replace(timelines, folder=shown_in[path])
            work = Work(path, config, begun, folder / f"{n:06d}", shown, threads)
            course.submit(engine, work)
        taken: dict[str, int] = {}
        for work, outcome in course.results(engine):
            prepared.result()
            _take(store, outcome, begun.run_id, taken, paths.index(work.path))
            shutil.rmtree(work.folder, ignore_errors=True)
            result.outcomes.append(outcome)
            if outcome.recording is not None:
                report(Progress(work.path.name, "done", outcome.recording.frame_count, 1.0))
        prepared.result()
        result.outcomes.sort(key=lambda outcome: paths.index(outcome.path))
        stored = [o.recording.recording_id for o in result.outcomes if o.recording is not None]
        tell_repeated_frames(store, stored, begun.run_id)
        finish_run(store, begun.run_id)
    return result


def begin(config: Config, label: str | None) -> Begun:
    """Return a new run."""
    return Begun(new_run_id(), label, describe(config), library_versions())


def _prepare(store: Store, begun: Begun) -> None:
    store.prepare()
    begun.enter(store)


def estimate_again(database: Path, config: Config, label: str | None) -> tuple[str, int]:
    """Run pass 2 over all stored recordings as a new run; return its name and how many were done.

    One that fails keeps the estimates that it has; the table `diagnostics` has the reason.

    Raises:
        StoreError: the database does not exist, or cannot be written.
    """
    if not database.is_file():
        raise StoreError("there is no such database", where=Where(database))
    with Store.open(database) as store:
        run_id = start_run(
            store, "estimate", label, describe(config), library_versions(), __version__
        )
        rows = list_recordings(store).to_pylist()
        failed = 0
        for row in rows:
            path = Path(row["path"])
            found = attempt(path, _estimate_one, store, row, run_id, config)
            if isinstance(found, StadimeterError):
                if isinstance(found, StoreError) and not isinstance(found, RowsRefused):
                    raise found
                add_failure(store, path, found, run_id, row["recording_id"], "recording_failed")
                failed += 1
        finish_run(store, run_id)
    return run_id, len(rows) - failed


def _estimate_one(store: Store, row: dict[str, Any], run_id: str, config: Config) -> None:
    with store.transaction():
        choose_newest(store, row["recording_id"])
        estimate_recording(store, row["recording_id"], run_id, row["file_name"], config)


def _take(store: Store, outcome: Outcome, run_id: str, taken: dict[str, int], place: int) -> None:
    """Commit a recording whole, and the reason of a failure.

    Of files with the same content the last stays, whichever was finished first: `taken` has the places of
    those that are stored.

    Raises:
        StoreError: there is no room for it; that is nothing that the recording could help.
    """
    if isinstance(outcome.error, DiskRefused):  # any other error was in a database of its own
        raise outcome.error
    row = outcome.recording
    if row is not None and place > taken.get(row.recording_id, -1):
        try:
            with outcome.times.stage("store"), store.transaction():
                take_once(store, row, outcome.files, run_id)
            taken[row.recording_id] = place
        except RowsRefused as error:
            outcome.recording, outcome.error = None, named(outcome.path, error)
    if outcome.error is not None:
        stored = outcome.recording.recording_id if outcome.recording is not None else None
        add_failure(store, outcome.path, outcome.error, run_id, stored)


@contextmanager
def _held(database: Path, result: RunResult) -> Iterator[Store]:
    """Give the database to write to; leave no new one in which there is no recording.

    Only who holds it may take it away: it may be another process that made it.
    """
    new = not database.exists() or (database.is_file() and database.stat().st_size == 0)
    store = Store.hold(database)
    try:
        with store:
            yield store
    finally:
        if new and not result.stored:
            for name in (database.name, f"{database.name}.wal"):
                with suppress(OSError):
                    database.with_name(name).unlink(missing_ok=True)


@contextmanager
def _folder_beside(database: Path) -> Iterator[Path]:
    """Give a folder beside the database (the same disk) that is gone afterwards.

    Who holds the database holds it alone: folders that are there already were left by a run that
    was killed.
    """
    prefix = f".{database.name}.parts-"
    for left in database.parent.glob(f"{glob.escape(prefix)}*"):
        shutil.rmtree(left, ignore_errors=True)
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=database.parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if (
            folder.exists()
        ):  # one operation may fail, on a shared disk for one; two in a row seldom do
            shutil.rmtree(folder, ignore_errors=True)


def describe(config: Config) -> str:
    """Return a configuration as JSON, so that a run can be repeated."""
    return json.dumps(asdict(config), default=str, sort_keys=True)


def library_versions() -> str:
    """Return the versions of Python and of the libraries that numbers depend on, as JSON."""
    versions = {"stadimeter": __version__, "python": platform.python_version()}
    return json.dumps(versions | {name: version(name) for name in LIBRARIES}, sort_keys=True)
