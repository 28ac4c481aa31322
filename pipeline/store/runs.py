"""Runs: one row each, with the command, the configuration and the versions that made it."""

from __future__ import annotations

import uuid
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
