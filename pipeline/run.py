"""Recordings through both passes, into the database and onto timelines.

    measure (pass 1, in processes) -> store -> estimate (pass 2) -> timeline (in processes)

A recording is committed whole, with its estimates, or not at all. Only this process writes to the
database, because DuckDB lets one in; the others hand over Parquet files.
"""

from __future__ import annotations

import glob
import json
import multiprocessing
import platform
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from multiprocessing.managers import SyncManager
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.config import Config
from pipeline.errors import StadimeterError, StoreError, Where
from pipeline.first_pass import measure_recording
from pipeline.lifeline import die_with_parent
from pipeline.progress import Progress, Report, silent
from pipeline.records import Diagnostic, Severity
from pipeline.second_pass import estimate_recording
from pipeline.stages import StageTimes
from pipeline.store.database import RecordingRow, Store, new_run_id

LIBRARIES = ("numpy", "opencv-python-headless", "duckdb", "pyarrow", "mcap", "rerun-sdk", "scipy")


@dataclass(slots=True)
class Outcome:
    """What became of one recording."""

    path: Path
    recording: RecordingRow | None = None
    timelines: list[Path] = field(default_factory=list)
    error: StadimeterError | None = None
    times: StageTimes = field(default_factory=StageTimes)


@dataclass(slots=True)
class RunResult:
    """What became of all of them."""

    run_id: str
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def stored(self) -> list[Outcome]:
        """Recordings that are in the database."""
        return [o for o in self.outcomes if o.recording is not None]

    @property
    def failed(self) -> list[Outcome]:
        """Recordings of which nothing was stored."""
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
    timelines: Path | None = None,
    workers: int = 1,
    label: str | None = None,
    report: Report = silent,
) -> RunResult:
    """Measure, store and estimate recordings; write a timeline of each if a folder is given.

    Raises:
        StoreError: the database cannot be opened or written.
    """
    paths = list(dict.fromkeys(Path(p) for p in recordings))
    new = not database.exists()
    with (
        Store.hold(database) as store,
        ThreadPoolExecutor(1) as aside,
        _parts_folder(database) as parts,
    ):
        result = RunResult(new_run_id())
        run_id = result.run_id
        begun = aside.submit(_begin, store, run_id, config, label)
        # Half a second for a new one's tables and views, which is nobody's to wait for. With one that
        # is there more can go wrong: that is to be known before an hour of footage is measured.
        if not new:
            begun.result()
        for outcome, folder in _measured(paths, config, parts, workers, report):
            begun.result()
            result.outcomes.append(outcome)
            _store(store, run_id, outcome, folder, config, report)
            shutil.rmtree(folder, ignore_errors=True)
            if timelines is not None and outcome.recording is not None:
                with outcome.times.stage("timeline"):
                    outcome.timelines = write_timelines_of(
                        store, outcome, timelines, config, report
                    )
            if outcome.recording is not None:
                frames = outcome.recording.frame_count
                report(Progress(outcome.path.name, "done", frames, 1.0))
        begun.result()
        store.finish_run(run_id)
    return result


def _begin(store: Store, run_id: str, config: Config, label: str | None) -> None:
    store.prepare()
    store.start_run("run", label, describe(config), library_versions(), __version__, run_id)


def estimate_again(database: Path, config: Config, label: str | None) -> tuple[str, int]:
    """Run pass 2 over all stored recordings as a new run; return its name and how many they are.

    Raises:
        StoreError: the database does not exist, or cannot be written.
    """
    if not database.is_file():
        raise StoreError("there is no such database", where=Where(database))
    with Store.open(database) as store:
        run_id = store.start_run(
            "estimate", label, describe(config), library_versions(), __version__
        )
        rows = store.recordings().to_pylist()
        for row in rows:
            with store.transaction():
                estimate_recording(store, row["recording_id"], run_id, row["file_name"], config)
        store.finish_run(run_id)
    return run_id, len(rows)


def _measured(
    paths: list[Path], config: Config, parts: Path, workers: int, report: Report
) -> Iterator[tuple[Outcome, Path]]:
    """Yield each recording as its first pass ends, with the folder that holds its tables."""
    folders = {path: parts / f"{index:06d}" for index, path in enumerate(paths)}
    if workers <= 1 or len(paths) == 1:
        for path, folder in folders.items():
            yield _measure(path, config, folder, threads=2, report=report), folder
        return
    context = multiprocessing.get_context("spawn")
    manager = SyncManager(ctx=context)
    manager.start(initializer=die_with_parent)
    with (
        manager,
        ProcessPoolExecutor(workers, mp_context=context, initializer=die_with_parent) as pool,
    ):
        queue = manager.Queue()
        jobs: dict[Future[Outcome], Path] = {
            pool.submit(_measure_in_process, path, config, folder, queue): folder
            for path, folder in folders.items()
        }
        for job in _as_completed(jobs, queue, report):
            yield job.result(), jobs[job]


def _as_completed(
    jobs: Iterable[Future[Outcome]], queue: Any, report: Report
) -> Iterator[Future[Outcome]]:
    """Yield jobs as they end, and pass on their progress meanwhile."""
    waiting = set(jobs)
    while waiting:
        try:
            done = next(as_completed(waiting, timeout=0.2))
        except TimeoutError:
            done = None
        while not queue.empty():
            report(queue.get())
        if done is not None:
            waiting.discard(done)
            yield done


def _measure_in_process(path: Path, config: Config, folder: Path, queue: Any) -> Outcome:
    return _measure(path, config, folder, threads=1, report=queue.put)


def _measure(path: Path, config: Config, folder: Path, *, threads: int, report: Report) -> Outcome:
    outcome = Outcome(path)
    try:
        outcome.recording = measure_recording(
            path, config, folder, threads=threads, report=report, times=outcome.times
        )
    except StadimeterError as error:
        outcome.error = error
    except OSError as error:
        problem = f"cannot be read: {error.strerror or error}"
        outcome.error = StadimeterError(f"{path} {problem}")
    return outcome


def _store(
    store: Store, run_id: str, outcome: Outcome, folder: Path, config: Config, report: Report
) -> None:
    """Commit a recording with its estimates in one transaction, or the reason why not.

    Raises:
        StoreError: there is no room for it; that is nothing that the recording could help.
    """
    if isinstance(outcome.error, StoreError):
        raise outcome.error
    if outcome.recording is None:
        note = Diagnostic(Severity.ERROR, "unreadable_file", str(outcome.error))
        with store.transaction():
            store.add_diagnostics([note], None, run_id, outcome.path.name)
        return
    report(Progress(outcome.path.name, "estimate", outcome.recording.frame_count, 1.0))
    with store.transaction():
        with outcome.times.stage("store"):
            recording_id = store.ingest(outcome.recording, folder, run_id)
        with outcome.times.stage("estimate"):
            estimate_recording(store, recording_id, run_id, outcome.path.name, config)


def write_timelines_of(
    store: Store, outcome: Outcome, folder: Path, config: Config, report: Report
) -> list[Path]:
    """Write the Rerun recordings of a stored recording; a long one is split by time."""
    from dashboards.split import write_timelines  # heavy, and not always wanted

    recording = outcome.recording
    assert recording is not None  # noqa: S101  (narrowing)
    report(Progress(outcome.path.name, "timeline", recording.frame_count, 1.0))
    return write_timelines(store, recording.recording_id, outcome.path, folder, config)


@contextmanager
def _parts_folder(database: Path) -> Iterator[Path]:
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


def describe(config: Config) -> str:
    """Return a configuration as JSON, so that a run can be repeated."""
    return json.dumps(asdict(config), default=str, sort_keys=True)


def library_versions() -> str:
    """Return the versions of Python and of the libraries that numbers depend on, as JSON."""
    versions = {"stadimeter": __version__, "python": platform.python_version()}
    return json.dumps(versions | {name: version(name) for name in LIBRARIES}, sort_keys=True)
