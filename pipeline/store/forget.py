"""Taking a recording's rows out of the database."""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

from pipeline.store.columns import RECORDING_TABLES, TRUTH_TABLES
from pipeline.store.database import Store


def forget(store: Store, recording_id: str) -> None:
    """Delete the rows of a recording, but for truth from files; call inside a transaction."""
    for table in RECORDING_TABLES:
        also = " AND file_name IS NULL" if table in TRUTH_TABLES else ""
        store.connection.execute(
            f"DELETE FROM {table} WHERE recording_id = ?{also}", [recording_id]
        )
