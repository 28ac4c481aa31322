"""Measurements that stay beside the current one: the same recording, measured with other settings.

The tables of `main` hold one measurement of a recording. Before another one with other settings comes,
its rows go to tables of the same names in the schema `kept`, with the run that measured them in
`measured_by`. So no view can mix two measurements, and none gets slower.
"""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pipeline.store.columns import RECORDING_TABLES, TRUTH_TABLES
from pipeline.store.database import Store
from pipeline.store.forget import forget

Row = Mapping[str, Any]
_RUN = "SELECT run_id, label, software_version, configuration, keep FROM runs"


def make_room(store: Store, recording_id: str, new: Row) -> None:
    """Take away the measurement of a recording before another one comes; inside a transaction.

    One with the same settings, version and label is replaced: its rows are deleted, unless its run is
    to be kept. Any other goes to the schema `kept`.

    Args:
        store: the database.
        recording_id: the recording.
        new: row of `runs` of the run whose rows come.
    """
    for old in _runs(store, "SELECT run_id FROM recordings", recording_id):
        if old["run_id"] != new["run_id"] and (old["keep"] or not _same(old, new)):
            set_aside(store, recording_id)
    forget(store, recording_id)
    store.connection.execute("DELETE FROM chosen_runs WHERE recording_id = ?", [recording_id])
    for old in _runs(store, "SELECT measured_by FROM kept_runs", recording_id):
        if old["run_id"] == new["run_id"] or (_same(old, new) and not old["keep"]):
            drop_kept(store, recording_id, old["run_id"])


def set_aside(store: Store, recording_id: str) -> None:
    """Copy the rows of a recording to the schema `kept`; inside a transaction.

    Truth of files belongs to the recording and not to a measurement: it is not copied.
    """
    (measured_by,) = _only(
        store, "SELECT run_id FROM recordings WHERE recording_id = ?", recording_id
    )
    drop_kept(store, recording_id, measured_by)
    for table in RECORDING_TABLES:
        store.connection.execute(
            f"INSERT INTO kept.{table} BY NAME SELECT ? AS measured_by, * FROM main.{table} "
            f"WHERE recording_id = ? {_own(table)}",
            [measured_by, recording_id],
        )
    store.connection.execute(
        "INSERT INTO kept_runs BY NAME SELECT r.recording_id, r.run_id AS measured_by, "
        "e.run_id, r.file_name FROM recordings AS r, ("
        "SELECT DISTINCT run_id FROM estimates WHERE recording_id = $1 "
        "UNION SELECT run_id FROM recordings WHERE recording_id = $1) AS e "
        "WHERE r.recording_id = $1",
        [recording_id],
    )


def bring_back(store: Store, recording_id: str, measured_by: str) -> None:
    """Let a kept measurement and the current one change places; inside a transaction.

    Matches with truth of files that came meanwhile are to be made again by the caller.
    """
    set_aside(store, recording_id)
    restore(store, recording_id, measured_by)


def restore(store: Store, recording_id: str, measured_by: str) -> None:
    """Put a kept measurement in the place of the current one, which is lost; inside a transaction."""
    forget(store, recording_id)
    for table in RECORDING_TABLES:
        store.connection.execute(
            f"INSERT INTO main.{table} BY NAME SELECT * EXCLUDE (measured_by) "
            f"FROM kept.{table} WHERE recording_id = ? AND measured_by = ?",
            [recording_id, measured_by],
        )
    drop_kept(store, recording_id, measured_by)


def drop_kept(store: Store, recording_id: str, measured_by: str) -> None:
    """Delete a kept measurement; inside a transaction."""
    for table in (*(f"kept.{name}" for name in RECORDING_TABLES), "kept_runs"):
        store.connection.execute(
            f"DELETE FROM {table} WHERE recording_id = ? AND measured_by = ?",
            [recording_id, measured_by],
        )


def drop_all_kept(store: Store, recording_id: str) -> None:
    """Delete all kept measurements of a recording; inside a transaction."""
    found = store.connection.execute(
        "SELECT DISTINCT measured_by FROM kept_runs WHERE recording_id = ?", [recording_id]
    ).fetchall()
    for (measured_by,) in found:
        drop_kept(store, recording_id, measured_by)


def _runs(store: Store, ids: str, recording_id: str) -> list[dict[str, Any]]:
    return (
        store.connection.sql(
            f"{_RUN} WHERE run_id IN ({ids} WHERE recording_id = ?)", params=[recording_id]
        )
        .to_arrow_table()
        .to_pylist()
    )


def _own(table: str) -> str:
    return "AND file_name IS NULL" if table in TRUTH_TABLES else ""


def _same(one: Row, other: Row) -> bool:
    """Return true if two runs have the same version, label and settings, those of pictures aside."""
    if any(one[name] != other[name] for name in ("label", "software_version")):
        return False
    return _settings(one) == _settings(other)


def _settings(run: Row) -> dict[str, object]:
    settings = dict(json.loads(run["configuration"]))
    settings.pop("timeline", None)
    return settings


def _only(store: Store, sql: str, recording_id: str) -> tuple[Any, ...]:
    (row,) = store.connection.execute(sql, [recording_id]).fetchall()
    return tuple(row)
