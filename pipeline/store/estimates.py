"""Estimates in and out: the rows of pass 2, each of a recording and a run."""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

from collections.abc import Mapping

import pyarrow as pa

from pipeline.core.tables import PASS_TWO
from pipeline.store.columns import ESTIMATE_TABLES, ROW_ORDER, stored_columns
from pipeline.store.database import Store, read_once


def forget_estimates(store: Store, recording_id: str, run_id: str) -> None:
    """Delete the estimates of a recording in a run; call inside a transaction."""
    for table in ESTIMATE_TABLES:
        store.connection.execute(
            f"DELETE FROM {table} WHERE recording_id = ? AND run_id = ?", [recording_id, run_id]
        )


def forget_diagnostics(store: Store, recording_id: str, run_id: str) -> None:
    """Delete what a run noted of a recording; call inside a transaction."""
    store.connection.execute(
        "DELETE FROM diagnostics WHERE recording_id = ? AND run_id = ?", [recording_id, run_id]
    )


def add_estimates(
    store: Store, recording_id: str, run_id: str, made: Mapping[str, pa.Table]
) -> None:
    """Add rows of the tables of pass 2, by table; call inside a transaction."""
    for table, rows in made.items():
        with store.incoming("incoming", read_once(rows.select(PASS_TWO[table].names))):
            store.connection.execute(
                f"INSERT INTO {table} BY NAME SELECT ? AS recording_id, ? AS run_id, "
                f"{stored_columns(table)} FROM incoming ORDER BY {ROW_ORDER[table]}",
                [recording_id, run_id],
            )


def add_calibrations(store: Store, calibrations: pa.Table, run_id: str) -> None:
    """Store the calibrations that a run used or made, each once; call inside a transaction."""
    with store.incoming("incoming", calibrations):
        store.connection.execute(
            f"INSERT INTO calibrations BY NAME SELECT ? AS run_id, {stored_columns('calibrations')} "
            "FROM incoming ANTI JOIN (FROM calibrations WHERE run_id = ?) USING (calibration_id)",
            [run_id, run_id],
        )


def read_current(store: Store, table: str, recording_id: str) -> pa.Table:
    """Return a recording's rows of a table of pass 2 that the newest run made.

    Raises:
        ValueError: it is no such table.
    """
    if table not in ESTIMATE_TABLES:
        raise ValueError(f"{table!r} is no table of estimates")
    return store.connection.sql(
        f"SELECT t.* FROM {table} t SEMI JOIN main.current_run USING (recording_id, run_id) "
        f"WHERE recording_id = ? ORDER BY {ROW_ORDER[table]}",
        params=[recording_id],
    ).to_arrow_table()
