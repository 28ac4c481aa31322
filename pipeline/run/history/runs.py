"""Runs of stored recordings: listing them, keeping, removing, and choosing the one that counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow as pa

from pipeline.core.errors import StoreError, UsageError, Where
from pipeline.run.truth import match_again
from pipeline.store.database import Store
from pipeline.store.estimates import forget_diagnostics, forget_estimates
from pipeline.store.kept import bring_back, drop_kept, restore
from pipeline.store.recordings import has_truth_of_files
from pipeline.store.runs import choose, choose_newest, forget_unused_runs, set_keep

Row = dict[str, Any]


def list_runs(database: Path) -> pa.Table:
    """Return the rows of the view `all_runs`: a row for each recording and run.

    Raises:
        StoreError: the database does not exist, or cannot be read.
    """
    with Store.open_current(database) as store:
        return store.query("FROM all_runs")


def keep_run(database: Path, name: str, *, keep: bool = True) -> list[Row]:
    """Say if a later run of the same settings may not replace a run; return its rows of `all_runs`.

    Raises:
        UsageError: no run has that name.
        StoreError: the database does not exist, or cannot be written.
    """
    with _opened(database) as store:
        found = _named(store, name)
        with store.transaction():
            for run_id in {row["run_id"] for row in found}:
                set_keep(store, run_id, keep)
        return found


def make_current(database: Path, name: str) -> list[Row]:
    """Let the estimates of a run count for its recordings; return its rows of `all_runs`.

    A measurement that was kept aside changes places with the current one.

    Raises:
        UsageError: no run has that name, or several of one recording have it.
        StoreError: the database does not exist, or cannot be written.
    """
    with _opened(database) as store:
        found = _one_a_recording(store, name)
        with store.transaction():
            for row in found:
                key = row["recording_id"]
                if row["is_kept_aside"]:
                    bring_back(store, key, row["measured_by"])
                    _match_files(store, key)
                choose(store, key, row["run_id"])
        return found


def remove_run(database: Path, name: str) -> list[Row]:
    """Remove what a run measured and estimated; return its rows of `all_runs`.

    With a measurement go the later estimates of it. Where the current one is removed, the newest that is
    kept aside takes its place.

    Raises:
        UsageError: no run has that name, several of one recording have it, or it holds the only
            measurement of a recording.
        StoreError: the database does not exist, or cannot be written.
    """
    with _opened(database) as store:
        found = _one_a_recording(store, name)
        with store.transaction():
            for row in found:
                _remove(store, row)
            forget_unused_runs(store, {row["run_id"] for row in found})
        return found


def _remove(store: Store, row: Row) -> None:
    key, run_id = row["recording_id"], row["run_id"]
    if row["is_kept_aside"]:
        drop_kept(store, key, row["measured_by"])
        return
    if run_id != row["measured_by"]:
        forget_estimates(store, key, run_id)
        forget_diagnostics(store, key, run_id)
    else:
        others = store.connection.execute(
            "SELECT measured_by FROM kept_runs JOIN runs ON runs.run_id = measured_by "
            "WHERE recording_id = ? ORDER BY started_at DESC LIMIT 1",
            [key],
        ).fetchone()
        if others is None:
            raise UsageError(
                f"{row['run_label'] or run_id} is the only measurement of {row['file_name']}",
                where=Where(store.path),
                remedy="Measure it again with other settings first, or use another database",
            )
        restore(store, key, others[0])
        _match_files(store, key)
    choose_newest(store, key)


def _match_files(store: Store, recording_id: str) -> None:
    """Match a measurement that came back with truth of files, which may have come meanwhile."""
    if has_truth_of_files(store, recording_id):
        match_again(store, recording_id)


def _opened(database: Path) -> Store:
    if not database.is_file():
        raise StoreError("there is no such database", where=Where(database))
    return Store.open(database)


def _named(store: Store, name: str) -> list[Row]:
    """Return the rows of `all_runs` of the runs with a label or id."""
    rows = store.query("FROM all_runs").to_pylist()
    found = [row for row in rows if name in (row["run_id"], row["run_label"])]
    if not found:
        known = ", ".join(dict.fromkeys(row["run_label"] or row["run_id"] for row in rows))
        raise UsageError(
            f"there is no run {name!r}",
            where=Where(store.path),
            remedy=f"There are: {known}" if known else "It holds no recordings",
        )
    return found


def _one_a_recording(store: Store, name: str) -> list[Row]:
    """Return the rows of `all_runs` of a name; refuse a label that several runs of one recording have."""
    found = _named(store, name)
    if len({row["recording_id"] for row in found}) < len(found):
        ids = ", ".join(dict.fromkeys(row["run_id"] for row in found))
        raise UsageError(
            f"several runs of one recording have the label {name!r}",
            where=Where(store.path),
            remedy=f"Give one by its id: {ids}",
        )
    return found
