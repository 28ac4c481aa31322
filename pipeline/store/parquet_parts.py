"""Tables of pass 1, streamed to Parquet and back: one file a table, so that memory stays flat."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.core.errors import DiskRefused, StoreError, Where
from pipeline.core.tables import PARTS

# Rows that go to the disk together: each piece costs the file, and who writes or reads it, 10 kB of
# description.
ROWS_WRITTEN = 10_000
ROWS_READ = 20_000  # at about 250 bytes, some of it twice


class PartWriter:
    """Writer of the tables of pass 1 to a folder, some batches at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with _storing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        self._writers: dict[str, pq.ParquetWriter] = {}
        self._waiting: dict[str, list[pa.Table]] = {}

    def __enter__(self) -> PartWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None:
            for writer in self._writers.values():
                with suppress(OSError):  # the disk may be full, and the parts are not wanted
                    writer.close()
            return
        with _storing(self.folder):
            for name in PARTS:
                self._flush(name)  # a table without rows is a file without rows
            for writer in self._writers.values():
                writer.close()

    def write(self, name: str, columns: pa.Table | Mapping[str, Sequence[Any]]) -> None:
        """Append rows to a table; NaN becomes null."""
        schema = PARTS[name]
        if isinstance(columns, pa.Table):
            table = _with_all_columns(columns, schema)
        else:
            table = as_table(columns, schema)
        waiting = self._waiting.setdefault(name, [])
        waiting.append(table)
        if sum(some.num_rows for some in waiting) >= ROWS_WRITTEN:
            with _storing(self.folder):
                self._flush(name)

    def _flush(self, name: str) -> None:
        writer = self._writer(name)
        waiting = [table for table in self._waiting.pop(name, []) if table.num_rows]
        if waiting:
            writer.write_table(pa.concat_tables(waiting))

    def _writer(self, name: str) -> pq.ParquetWriter:
        if name not in self._writers:
            path = self.folder / f"{name}.parquet"
            self._writers[name] = pq.ParquetWriter(path, PARTS[name], compression="lz4")
        return self._writers[name]


def read_part(folder: Path, table: str) -> Iterator[pa.Table]:
    """Yield the rows of a table of pass 1, some at a time.

    It is in `<table>.parquet`, or in `<table>-*.parquet` in order.

    Raises:
        StoreError: there is no such file.
    """
    files = [folder / f"{table}.parquet"]
    if not files[0].exists():
        files = sorted(folder.glob(f"{table}-*.parquet"))
    if not files:
        raise StoreError(f"pass 1 left no {table}", where=Where(folder))
    schema, waiting, count = PARTS[table], list[pa.RecordBatch](), 0
    for path in files:
        with pq.ParquetFile(path) as file:
            for batch in batches(file):
                waiting.append(batch)
                count += batch.num_rows
                if count >= ROWS_READ:
                    yield _as_one(waiting, schema)
                    waiting, count = [], 0
    if count:
        yield _as_one(waiting, schema)


def batches(file: pq.ParquetFile) -> Iterator[pa.RecordBatch]:
    """Yield the rows of a file.

    Its pieces are asked for one by one: a reader of several keeps the bytes of all until it ends.
    """
    for number in range(file.num_row_groups):
        yield from file.iter_batches(batch_size=ROWS_READ, row_groups=[number])


def _as_one(batches: list[pa.RecordBatch], schema: pa.Schema) -> pa.Table:
    return _with_all_columns(pa.Table.from_batches(batches), schema)


def _with_all_columns(table: pa.Table, schema: pa.Schema) -> pa.Table:
    """Return a table in this schema; columns that it lacks are null."""
    for name in schema.names:
        if name not in table.column_names:
            table = table.append_column(name, pa.nulls(table.num_rows, schema.field(name).type))
    return table.select(schema.names).cast(schema)


@contextmanager
def _storing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise DiskRefused(
            f"the measurements cannot be stored beside the database: {_reason(error)}",
            where=Where(folder),
            remedy="Free some disk space, then run the same command again",
        ) from error


def _reason(error: OSError) -> str:
    """Return the system's words; Arrow puts its own around them."""
    return os.strerror(error.errno) if error.errno else str(error)


def as_table(columns: Mapping[str, Sequence[Any]], schema: pa.Schema) -> pa.Table:
    """Return columns as a table of this schema; a NaN is unknown, so it becomes null."""
    arrays = [pa.array(columns[field.name], type=field.type, from_pandas=True) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)
