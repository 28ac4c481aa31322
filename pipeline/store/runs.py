"""Runs: one row each, with the command, the configuration and the versions that made it."""

from __future__ import annotations

import uuid
from collections.abc import Collection
from datetime import UTC, datetime

from pipeline.store.database import Store


def new_run_id() -> str:
    """Return a name that no other run has."""
    return uuid.uuid4().hex[:12]


def start_run(
    store: Store,
    command: str,
    label: str | None,
    configuration: str,
    libraries: str,
    version: str,
    run_id: str | None = None,
) -> str:
    """Enter a run, and return its name, a new one if none is given."""
    run_id = run_id or new_run_id()
    with store.transaction():
        store.connection.execute(
            "INSERT INTO runs BY NAME SELECT ? AS run_id, ? AS command, ? AS label, "
            "? AS started_at, ? AS software_version, ? AS libraries, ? AS configuration",
            [run_id, command, label, datetime.now(UTC), version, libraries, configuration],
        )
    return run_id


def finish_run(store: Store, run_id: str) -> None:
    """Enter the time at which a run ended."""
    with store.transaction():
        store.connection.execute(
            "UPDATE runs SET finished_at = ? WHERE run_id = ?", [datetime.now(UTC), run_id]
        )


def choose_newest(store: Store, recording_id: str) -> None:
    """Forget a choice of the run that counts for a recording; call inside a transaction."""
    store.connection.execute("DELETE FROM chosen_runs WHERE recording_id = ?", [recording_id])


def choose(store: Store, recording_id: str, run_id: str) -> None:
    """Let a run count for a recording; call inside a transaction."""
    choose_newest(store, recording_id)
    store.connection.execute("INSERT INTO chosen_runs VALUES (?, ?)", [recording_id, run_id])


def set_keep(store: Store, run_id: str, keep: bool) -> None:
    """Say if a later run of the same settings may not replace a run; call inside a transaction."""
    store.connection.execute("UPDATE runs SET keep = ? WHERE run_id = ?", [keep, run_id])


def forget_unused_runs(store: Store, run_ids: Collection[str]) -> None:
    """Delete those of some runs that no rows are of any more; inside a transaction."""
    store.connection.execute(
        "DELETE FROM runs WHERE list_contains(?, run_id) "
        "AND run_id NOT IN (SELECT run_id FROM recordings) "
        "AND run_id NOT IN (SELECT run_id FROM estimates) "
        "AND run_id NOT IN (SELECT run_id FROM diagnostics) "
        "AND run_id NOT IN (SELECT run_id FROM kept_runs)",
        [list(run_ids)],
    )
