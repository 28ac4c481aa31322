"""Hash of all rows of a recording: equal rows, whatever their order, have equal hashes."""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

import hashlib

from pipeline.store.columns import ESTIMATE_TABLES, RECORDING_TABLES
from pipeline.store.database import Store

# Columns that say when, from where and under which name rows were made, not what was measured.
_OF_THE_RUN = ("run_id", "file_name", "path", "tables_sha256")


def tables_sha256(store: Store, recording_id: str, run_id: str) -> str:
    """Return the hash of a recording's rows, with the estimates and diagnostics of one run.

    Each row is hashed as text (numbers in the fewest digits that give them back); the hashes of a
    table are added up, so that no order and no memory is needed. It tells results apart that differ
    by chance or error; it is no proof against somebody who makes two rows with one hash on purpose.
    """
    lines = []
    for table in RECORDING_TABLES:
        columns = [row[0] for row in store.connection.execute(f"DESCRIBE {table}").fetchall()]
        hashed = ", ".join(sorted(c for c in columns if c not in _OF_THE_RUN))
        of_run = "AND run_id = ?" if table in (*ESTIMATE_TABLES, "diagnostics") else ""
        found = store.connection.execute(
            f"""
            WITH texts AS (
                SELECT md5(row({hashed})::VARCHAR) AS digest
                FROM {table} WHERE recording_id = ? {of_run}
            )
            SELECT count(*), sum(('0x' || digest[:16])::UBIGINT::HUGEINT),
                sum(('0x' || digest[17:])::UBIGINT::HUGEINT) FROM texts
            """,
            [recording_id, run_id] if of_run else [recording_id],
        ).fetchall()
        lines.append(f"{table} {found[0]}")
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def keep_tables_sha256(store: Store, recording_id: str, run_id: str) -> str:
    """Store the hash of a recording's rows; call inside a transaction, when all of them are there."""
    found = tables_sha256(store, recording_id, run_id)
    store.connection.execute(
        "UPDATE recordings SET tables_sha256 = ? WHERE recording_id = ?", [found, recording_id]
    )
    return found


def stored_tables_sha256(store: Store, recording_id: str) -> str | None:
    """Return the hash that is kept with a recording; None if there is none."""
    found = store.connection.execute(
        "SELECT tables_sha256 FROM recordings WHERE recording_id = ?", [recording_id]
    ).fetchall()
    return found[0][0] if found else None
