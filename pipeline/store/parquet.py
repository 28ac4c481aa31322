"""Finished recordings in a folder, asked with the same SQL as a database, or put into one.

The tables become views over Parquet files, with the same names, columns and comments; functions and
views of `schemas/sql` are applied to them unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.cluster.manifest import (
    Manifest,
    Part,
    describe_part,
    file_sha256,
    read_manifests,
)
from pipeline.core.errors import StoreError, Where
from pipeline.store.connection import CONFIG
from pipeline.store.database import RECORDING_TABLES, Store
from pipeline.store.parquet_parts import batches
from pipeline.store.schema import apply_schema

SHARED_TABLES = (*RECORDING_TABLES, "runs", "calibrations")
ROW_GROUP = 122_880  # DuckDB reads a Parquet file by row groups, each by one core
MERGED_TOGETHER = 32  # recordings a transaction: one alone costs more in the disk than in rows

# Every recording of a run brings the run's row, and the calibrations that it used.
_ROWS = {
    "runs": """
        SELECT * REPLACE (min(started_at) OVER run AS started_at, max(finished_at) OVER run AS
            finished_at)
        FROM {files}
        WINDOW run AS (PARTITION BY run_id)
        QUALIFY row_number() OVER run = 1
    """,
    "calibrations": "SELECT DISTINCT * FROM {files}",
}


def export(store: Store, target: Path, folder: Path) -> dict[str, Part]:
    """Write what a store of one recording holds to a new folder, a Parquet file a table.

    Returns what a manifest says of the files, by table.
    """
    files = write_rows(store, target, "zstd")
    return {table: describe_part(folder, path) for table, path in files.items()}


def write_rows(store: Store, target: Path, compression: str) -> dict[str, Path]:
    """Write what a store of one recording holds to a folder; return the file of each table."""
    found = {table: target / f"{table}.parquet" for table in SHARED_TABLES}
    for table, path in found.items():
        with (
            store.rows(table) as reader,
            pq.ParquetWriter(
                path,
                reader.schema,
                compression=compression,
                use_dictionary=_repeating(reader.schema),
            ) as writer,
        ):
            for batch in reader:
                writer.write_batch(batch, row_group_size=ROW_GROUP)
    return found


def take_rows(store: Store, recording_id: str | None, files: Mapping[str, Path]) -> None:
    """Replace a recording by its rows in files; call inside a transaction.

    Without an id they are what is said of a file that is no recording.
    """
    if recording_id is not None:
        store.forget(recording_id)
    for table, path in files.items():
        with pq.ParquetFile(path) as file:
            rows = pa.RecordBatchReader.from_batches(file.schema_arrow, batches(file))
            store.take(table, rows)


def _repeating(schema: pa.Schema) -> list[str]:
    """Return the columns whose values repeat: text, not measured numbers."""
    return [f.name for f in schema if pa.types.is_string(f.type)]


def open_shared(folder: Path) -> Store:
    """Open a folder of finished recordings for questions, as `Store.open` does a database.

    No question can reach any other file, or change one.

    Raises:
        StoreError: there are none, or they are of another version.
    """
    manifests = list(read_manifests(folder))
    root = str(folder.absolute() / "parts")
    locked = ("enable_external_access", "lock_configuration")
    connection = duckdb.connect(config={k: v for k, v in CONFIG.items() if k not in locked})
    connection.execute(f"SET allowed_directories = ['{_quoted(root)}']")
    for name in locked:
        connection.execute(f"SET {name} = {CONFIG[name]}")
    # Views over the files come last: what is bound to a view reads the heads of files each time.
    apply_schema(connection)
    _views_for_tables(connection, folder.absolute(), manifests)
    return Store(connection, folder)


def _views_for_tables(
    connection: duckdb.DuckDBPyConnection, folder: Path, manifests: Sequence[Manifest]
) -> None:
    """Put views over the files in the place of the tables; comments stay."""
    for table in SHARED_TABLES:
        files = [str(folder / m.parts[table].path) for m in manifests if m.parts[table].rows]
        if not files:
            continue  # the empty table says the same
        columns = connection.execute(
            "SELECT column_name, data_type, comment FROM duckdb_columns() "
            "WHERE table_name = ? AND schema_name = 'main' ORDER BY column_index",
            [table],
        ).fetchall()
        (about,) = connection.execute(
            "SELECT comment FROM duckdb_tables() WHERE table_name = ?", [table]
        ).fetchall()
        listed = ", ".join(f"'{_quoted(f)}'" for f in files)
        rows = _ROWS.get(table, "SELECT * FROM {files}").format(files=f"read_parquet([{listed}])")
        # Files that an older version wrote may lack columns: unknown.
        unknown = ", ".join(f"NULL::{kind} AS {column}" for column, kind, _ in columns)
        connection.execute(f"DROP TABLE {table}")
        connection.execute(
            f"CREATE VIEW {table} AS SELECT {unknown} WHERE FALSE UNION ALL BY NAME ({rows})"
        )
        connection.execute(f"COMMENT ON VIEW {table} IS '{_quoted(about[0])}'")
        for column, _, comment in columns:
            connection.execute(f"COMMENT ON COLUMN {table}.{column} IS '{_quoted(comment)}'")


def _quoted(text: str) -> str:
    return text.replace("'", "''")


def merge(folder: Path, database: Path) -> int:
    """Put all finished recordings into a database; return how many were not there already.

    Raises:
        StoreError: a file is missing or was changed, or the database cannot be written.
    """
    count = 0
    manifests = read_manifests(folder)
    with Store.open(database) as store:
        while together := list(islice(manifests, MERGED_TOGETHER)):
            missing = [m for m in together if not _is_there(store, m)]
            for manifest in missing:
                _check(folder, manifest)
            with store.transaction():
                for manifest in missing:
                    _take(store, folder, manifest)
            count += len(missing)
    return count


def _is_there(store: Store, manifest: Manifest) -> bool:
    if manifest.failure is None:
        return store.has_run_of(manifest.key, manifest.run_id)
    return store.has_failure_of(Path(manifest.source.path).name, manifest.run_id)


def _check(folder: Path, manifest: Manifest) -> None:
    for part in manifest.parts.values():
        path = folder / part.path
        if not path.is_file() or file_sha256(path) != part.sha256:
            raise StoreError(
                "is missing, or is not what was written",
                where=Where(path),
                remedy=f"Delete {manifest.key}.json in manifests, then run the recording again",
            )


def _take(store: Store, folder: Path, manifest: Manifest) -> None:
    files = {t: folder / p.path for t, p in manifest.parts.items() if p.rows and t in SHARED_TABLES}
    take_rows(store, manifest.key if manifest.failure is None else None, files)
