"""Rows of a whole recording as Parquet files, one for each table, and back into a database unchanged."""
# ruff: noqa: S608  (the text that is put into SQL is names of our own tables and columns)

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.store.columns import RECORDING_TABLES
from pipeline.store.database import Store
from pipeline.store.kept import make_room
from pipeline.store.parquet_parts import batches

FILE_TABLES = (*RECORDING_TABLES, "runs", "calibrations")
ROW_GROUP = 122_880  # DuckDB reads a Parquet file by row groups, each by one core
# Tables with rows that several recordings bring, and the columns by which one is known.
_BROUGHT_TWICE = {"runs": "run_id", "calibrations": "run_id, calibration_id"}


def write_rows(store: Store, folder: Path, compression: str) -> dict[str, Path]:
    """Write all rows of a store of one recording to a folder; return the file of each table."""
    found = {table: folder / f"{table}.parquet" for table in FILE_TABLES}
    cursor = store.connection.cursor()
    try:
        for table, path in found.items():
            reader = cursor.sql(f"FROM {table}").to_arrow_reader()
            with pq.ParquetWriter(
                path,
                reader.schema,
                compression=compression,
                use_dictionary=_repeating(reader.schema),
            ) as writer:
                for batch in reader:
                    writer.write_batch(batch, row_group_size=ROW_GROUP)
    finally:
        cursor.close()
    return found


def take_rows(store: Store, recording_id: str | None, files: Mapping[str, Path]) -> None:
    """Take in the rows of a recording, which becomes the current measurement; inside a transaction.

    What was stored of it stays, kept aside, if its settings were others (`kept.make_room`).

    Without an id they are diagnostics of a file that is no recording.
    """
    if recording_id is not None:
        make_room(store, recording_id, _measuring_run(store, files))
    for table, path in files.items():
        source = "FROM incoming"
        if key := _BROUGHT_TWICE.get(table):
            source += f" ANTI JOIN (SELECT {key} FROM {table}) USING ({key})"
        with pq.ParquetFile(path) as file:
            rows = pa.RecordBatchReader.from_batches(file.schema_arrow, batches(file))
            with store.incoming("incoming", rows):
                store.connection.execute(f"INSERT INTO {table} BY NAME {source}")


def _measuring_run(store: Store, files: Mapping[str, Path]) -> dict[str, Any]:
    """Return the row of the run that measured: it comes with the recording, or is there already."""
    (run_id,) = pq.read_table(files["recordings"], columns=["run_id"])["run_id"].to_pylist()
    if "runs" in files:
        rows = pq.read_table(files["runs"])
    else:
        rows = store.connection.sql("FROM runs WHERE run_id = ?", params=[run_id]).to_arrow_table()
    return next(dict(row) for row in rows.to_pylist() if row["run_id"] == run_id)


def _repeating(schema: pa.Schema) -> list[str]:
    """Return the columns whose values repeat: text, not measured numbers."""
    return [f.name for f in schema if pa.types.is_string(f.type)]
