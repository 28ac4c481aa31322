"""A folder of finished recordings, queried with the same SQL as a database, or merged into one.

The tables become views over Parquet files, with the same names, columns and comments; functions and
views of `schemas/sql` are applied to them unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from itertools import islice
from pathlib import Path

import duckdb
import pyarrow.parquet as pq

from pipeline.cluster.manifest import (
    Manifest,
    Part,
    describe_part,
    file_sha256,
    read_manifests,
)
from pipeline.core.errors import RowsRefused, StoreError, Where
from pipeline.run.recording import add_failure, named
from pipeline.run.same_evidence import take_once, tell_repeated_frames
from pipeline.store.connection import CONFIG
from pipeline.store.database import Store
from pipeline.store.parquet import FILE_TABLES, take_rows, write_rows
from pipeline.store.recordings import RecordingRow, has_failure_of, has_run_of
from pipeline.store.schema import apply_schema

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
    """Write all rows of a store of one recording to a new folder, a Parquet file a table.

    Returns the description of each file, by table.
    """
    files = write_rows(store, target, "zstd")
    return {table: describe_part(folder, path) for table, path in files.items()}


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
    for table in FILE_TABLES:
        files = [str(folder / m.parts[table].path) for m in manifests if m.parts[table].rows]
        if not files:
            continue  # the empty table says the same
        columns = connection.execute(
            "SELECT column_name, data_type, comment FROM duckdb_columns() "
            "WHERE table_name = ? AND schema_name = 'main' ORDER BY column_index",
            [table],
        ).fetchall()
        (about,) = connection.execute(
            "SELECT comment FROM duckdb_tables() WHERE table_name = ? AND schema_name = 'main'",
            [table],
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

    One whose rows are refused costs itself only: the table `diagnostics` has the reason. What several
    recordings hold counts once, as in a run.

    Raises:
        StoreError: a file is missing or was changed, or the database cannot be written.
    """
    added: list[Manifest] = []
    manifests = read_manifests(folder)
    with Store.open(database) as store:
        while together := list(islice(manifests, MERGED_TOGETHER)):
            missing = [m for m in together if not _is_there(store, m)]
            for manifest in missing:
                _check(folder, manifest)
            added += _take_together(store, folder, missing)
        tell_repeated_frames(store, [m.key for m in added if m.failure is None])
    return len(added)


def _take_together(store: Store, folder: Path, manifests: Sequence[Manifest]) -> list[Manifest]:
    """Take recordings in; return those that were taken. If any is refused each goes by itself."""
    try:
        with store.transaction():
            for manifest in manifests:
                _take(store, folder, manifest)
        return list(manifests)
    except RowsRefused:
        return [m for m in manifests if _take_alone(store, folder, m)]


def _take_alone(store: Store, folder: Path, manifest: Manifest) -> bool:
    try:
        with store.transaction():
            _take(store, folder, manifest)
        return True
    except RowsRefused as error:
        path = Path(manifest.source.path)
        if not has_failure_of(store, path.name, manifest.run_id):
            add_failure(store, path, named(path, error), manifest.run_id)
        return False


def _is_there(store: Store, manifest: Manifest) -> bool:
    if manifest.failure is None:
        return has_run_of(store, manifest.key, manifest.run_id)
    return has_failure_of(store, Path(manifest.source.path).name, manifest.run_id)


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
    files = {t: folder / p.path for t, p in manifest.parts.items() if p.rows and t in FILE_TABLES}
    if manifest.failure is None:
        take_once(store, row_of(folder, manifest), files, manifest.run_id)
    else:
        take_rows(store, None, files)


def row_of(folder: Path, manifest: Manifest) -> RecordingRow:
    """Return the row of a finished recording, with the path of its file as the system knows it."""
    (row,) = pq.read_table(folder / manifest.parts["recordings"].path).to_pylist()
    names = {field.name for field in fields(RecordingRow)} - {"path"}
    return RecordingRow(Path(manifest.source.path), **{name: row[name] for name in names})
