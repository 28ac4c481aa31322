"""Recordings worked in several processes, each in a database of its own; one process collects them.

A worker does all of a recording: both passes and the timeline. The rows that it hands over are those that
would have been stored, so that taking them in is copying, and the collector hardly holds anybody up.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pyarrow.parquet as pq

from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError
from pipeline.core.progress import Progress, Report
from pipeline.parallel.processes import local_engine, tell
from pipeline.run.recording import Outcome, add_timelines, commit, measure
from pipeline.store.database import Store
from pipeline.store.parquet import take_rows, write_rows
from pipeline.store.recordings import refuse_collision
from pipeline.store.scratch import Begun, own_store


@dataclass(frozen=True, slots=True)
class Work:
    """Orders for a worker: one recording, and how to work it."""

    path: Path
    config: Config
    begun: Begun
    folder: Path  # of its own, beside the database
    timelines: Path | None


@dataclass(frozen=True, slots=True)
class Worked:
    """Result of a worker for one recording."""

    outcome: Outcome
    files: dict[str, Path]  # of rows, by table


def side_by_side(works: list[Work], workers: int, report: Report) -> Iterator[Worked]:
    """Yield what becomes of each recording, in the order in which they are finished."""
    with local_engine(workers, report, [__name__]) as engine:
        for work in works:
            engine.submit(work, work_alone, work)
        for work, found in engine.results():
            if isinstance(found, StadimeterError):
                found = Worked(Outcome(work.path, error=found), {})
            yield found
            shutil.rmtree(work.folder, ignore_errors=True)


def work_alone(work: Work) -> Worked:
    """Do all of a recording: what a worker process does.

    Raises:
        StoreError: what is made cannot be kept.
    """
    shutil.rmtree(work.folder, ignore_errors=True)  # by one that was killed
    parts = work.folder / "parts"
    outcome = measure(work.path, work.config, parts, threads=1, report=tell)
    row = outcome.recording
    if row is None:
        return Worked(outcome, {})
    tell(Progress(work.path.name, "estimate", row.frame_count, 1.0))
    with own_store(work.begun, work.folder, roomy=work.timelines is not None) as store:
        commit(store, row, parts, work.begun.run_id, work.config, outcome.times)
        with outcome.times.stage("store"):
            files = write_rows(store, work.folder, "lz4")
        if work.timelines is not None:
            add_timelines(store, outcome, work.timelines, work.config, tell)
    with_rows = {t: f for t, f in files.items() if t != "runs" and pq.read_metadata(f).num_rows}
    return Worked(outcome, with_rows)


def collect(store: Store, worked: Worked) -> None:
    """Commit what a worker made of a recording, in one transaction."""
    row = worked.outcome.recording
    if row is None:
        return
    with worked.outcome.times.stage("store"), store.transaction():
        refuse_collision(store, row)
        take_rows(store, row.recording_id, worked.files)
