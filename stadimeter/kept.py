"""Runs of a database: measurements of one recording with different settings stay side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stadimeter.arguments import PathLike
from stadimeter.results import Relation

Row = dict[str, Any]


def runs(db: PathLike) -> Relation:
    """Return a row for each recording and run, also of those that are kept aside: the view `all_runs`.

    Raises:
        StoreError: the database does not exist, or cannot be read.
    """
    from pipeline.run.history.runs import list_runs

    return Relation(list_runs(Path(db)))


def keep_run(db: PathLike, run: str, *, keep: bool = True) -> list[Row]:
    """Say if a later run of the same settings may not replace a run; return its rows of `all_runs`.

    Args:
        db: the database.
        run: label or id of the run.
        keep: False lets it be replaced again.

    Raises:
        UsageError: no run has that name.
        StoreError: the database does not exist, or cannot be written.
    """
    from pipeline.run.history import runs as stored_runs

    return stored_runs.keep_run(Path(db), run, keep=keep)


def make_current(db: PathLike, run: str) -> list[Row]:
    """Let the estimates of a run count for its recordings; return its rows of `all_runs`.

    A measurement that was kept aside changes places with the current one. A new run or estimation of
    the recording counts again when it comes.

    Args:
        db: the database.
        run: label or id of the run.

    Raises:
        UsageError: no run has that name, or several of one recording have it.
        StoreError: the database does not exist, or cannot be written.
    """
    from pipeline.run.history import runs as stored_runs

    return stored_runs.make_current(Path(db), run)


def remove_run(db: PathLike, run: str) -> list[Row]:
    """Remove what a run measured and estimated; return its rows of `all_runs`.

    With a measurement go the later estimates of it. Where the current one is removed, the newest that is
    kept aside takes its place.

    Args:
        db: the database.
        run: label or id of the run.

    Raises:
        UsageError: no run has that name, several of one recording have it, or it holds the only
            measurement of a recording.
        StoreError: the database does not exist, or cannot be written.
    """
    from pipeline.run.history import runs as stored_runs

    return stored_runs.remove_run(Path(db), run)
