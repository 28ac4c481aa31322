"""What pass 1 measures, streamed to Parquet: one file a table, so that memory stays flat."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.errors import StoreError, Where
from pipeline.records import PASS_ONE


class PartWriter:
    """Writes the tables of pass 1 to a folder, a batch at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with _storing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        self._writers: dict[str, pq.ParquetWriter] = {}

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
            for name in PASS_ONE:
                self._writer(name)  # a table without rows is a file without rows
            for writer in self._writers.values():
                writer.close()

    def write(self, name: str, columns: pa.Table | Mapping[str, Sequence[Any]]) -> None:
        """Append rows to a table; NaN becomes null."""
        schema = PASS_ONE[name]
        table = columns if isinstance(columns, pa.Table) else as_table(columns, schema)
        if table.num_rows:
            with _storing(self.folder):
                self._writer(name).write_table(table)

    def _writer(self, name: str) -> pq.ParquetWriter:
        if name not in self._writers:
            path = self.folder / f"{name}.parquet"
            self._writers[name] = pq.ParquetWriter(path, PASS_ONE[name], compression="lz4")
        return self._writers[name]


@contextmanager
def _storing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StoreError(
            f"what was measured cannot be kept beside the database: {_reason(error)}",
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
