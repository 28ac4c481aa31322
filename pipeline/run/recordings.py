"""Recordings through both passes, into the database and onto timelines.

    measure (pass 1) -> store -> estimate (pass 2) -> timeline

A recording is committed whole, with its estimates, or not at all. Only this process writes to the
database, because DuckDB lets one in; the others hand over Parquet files.
"""

from __future__ import annotations

import glob
import json
import platform
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from importlib.metadata import version
from pathlib import Path

from pipeline import __version__
from pipeline.core.config import Config
from pipeline.core.errors import StoreError, Where
from pipeline.core.progress import Progress, Report, silent
from pipeline.core.records import Diagnostic, Severity
from pipeline.run.pass_two import estimate_recording
from pipeline.run.recording import Outcome, add_timelines, commit, measure
from pipeline.run.workers import Work, collect, side_by_side
from pipeline.store.database import Store
from pipeline.store.recordings import add_diagnostics, list_recordings
from pipeline.store.runs import finish_run, new_run_id, start_run
from pipeline.store.scratch import Begun

LIBRARIES = ("numpy", "opencv-python-headless", "duckdb", "pyarrow", "mcap", "rerun-sdk", "scipy")


@dataclass(slots=True)
class RunResult:
    """Outcome of all recordings of a run."""

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
    begun = begin(config, label)
    result = RunResult(begun.run_id)
    here = workers <= 1 or len(paths) == 1
    with (
        Store.hold(database, roomy=timelines is not None and here) as store,
        ThreadPoolExecutor(1) as aside,
        _parts_folder(database) as parts,
    ):
        # A new one's tables and views take half a second, which is nobody's to wait for. With one that
        # is there more can go wrong: that is to be known before an hour of footage is measured.
        prepared = aside.submit(_prepare, store, begun)
        if not new:
            prepared.result()
        last = {path.stem: path for path in paths}  # a timeline has its recording's name
        works = [
            Work(
                path,
                config,
                begun,
                parts / f"{n:06d}",
                timelines if last[path.stem] == path else None,
            )
            for n, path in enumerate(paths)
        ]
        done = _one_by_one if here else partial(_side_by_side, workers)
        for outcome in done(works, store, prepared, report):
            result.outcomes.append(outcome)
            if outcome.recording is not None:
                frames = outcome.recording.frame_count
                report(Progress(outcome.path.name, "done", frames, 1.0))
        prepared.result()
        finish_run(store, begun.run_id)
    result.outcomes.sort(key=lambda outcome: paths.index(outcome.path))
    return result


def begin(config: Config, label: str | None) -> Begun:
    """Return a new run."""
    return Begun(new_run_id(), label, describe(config), library_versions())


def _prepare(store: Store, begun: Begun) -> None:
    store.prepare()
    begun.enter(store)


def estimate_again(database: Path, config: Config, label: str | None) -> tuple[str, int]:
    """Run pass 2 over all stored recordings as a new run; return its name and how many they are.

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
        for row in rows:
            with store.transaction():
                estimate_recording(store, row["recording_id"], run_id, row["file_name"], config)
        finish_run(store, run_id)
    return run_id, len(rows)


def _one_by_one(
    works: list[Work], store: Store, prepared: Future[None], report: Report
) -> Iterator[Outcome]:
    """Do all of one recording after another in this process."""
    for work in works:
        outcome = measure(work.path, work.config, work.folder, threads=2, report=report)
        prepared.result()
        row = outcome.recording
        if row is None:
            _store_reason(store, outcome, work.begun.run_id)
        else:
            report(Progress(work.path.name, "estimate", row.frame_count, 1.0))
            commit(store, row, work.folder, work.begun.run_id, work.config, outcome.times)
        shutil.rmtree(work.folder, ignore_errors=True)
        if row is not None and work.timelines is not None:
            add_timelines(store, outcome, work.timelines, work.config, report)
        yield outcome


def _side_by_side(
    workers: int, works: list[Work], store: Store, prepared: Future[None], report: Report
) -> Iterator[Outcome]:
    """Let processes do all of the recordings, and store what they made of them."""
    place = {work.path: n for n, work in enumerate(works)}
    taken: dict[str, int] = {}  # of files with the same content the last stays, whoever was faster
    for worked in side_by_side(works, workers, report):
        prepared.result()
        outcome = worked.outcome
        if outcome.recording is None:
            _store_reason(store, outcome, works[0].begun.run_id)
        elif place[outcome.path] > taken.get(outcome.recording.recording_id, -1):
            collect(store, worked)
            taken[outcome.recording.recording_id] = place[outcome.path]
        yield outcome


def _store_reason(store: Store, outcome: Outcome, run_id: str) -> None:
    """Commit the reason why a recording cannot be had.

    Raises:
        StoreError: there is no room for it; that is nothing that the recording could help.
    """
    if isinstance(outcome.error, StoreError):
        raise outcome.error
    note = Diagnostic(Severity.ERROR, "unreadable_file", str(outcome.error))
    with store.transaction():
        add_diagnostics(store, [note], None, run_id, outcome.path.name)


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
