"""The DuckDB database: opening, transactions and questions.

One process writes at a time, and shuts out all others meanwhile; any number may read. Values from files
reach SQL as parameters or as Arrow columns, never as text. What goes in and out: `runs`, `recordings`,
`estimates`.
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType

import duckdb
import pyarrow as pa

from pipeline.core.errors import DiskRefused, RowsRefused, StoreError, UsageError, Where
from pipeline.store.catalog import View, like, views
from pipeline.store.columns import RECORDING_TABLES, ROW_ORDER
from pipeline.store.connection import connect
from pipeline.store.schema import apply_schema, is_current

# DuckDB wraps a full disk in errors of several kinds; the system's own words stay.
# What DuckDB says where the disk is full, a file is as large as it may be, or a quota is used up: as an
# error of its own kind, or inside one that says that a COMMIT failed.
_REFUSALS = (
    *(os.strerror(code) for code in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EIO)),
    "Could not write",
)
# Errors after which this database takes no more; those of its disk any other one would meet as well.
_OF_THE_DATABASE = (duckdb.IOException, duckdb.FatalException, duckdb.InternalException)
# A transaction that is read-only does not keep these from the disk, where files may be reached at all.
_WRITING_FILES = (
    duckdb.StatementType.ATTACH,
    duckdb.StatementType.COPY,
    duckdb.StatementType.COPY_DATABASE,
    duckdb.StatementType.EXPORT,
)


class Store:
    """A connection to a stadimeter database; use `open`, and as a context manager."""

    def __init__(self, connection: duckdb.DuckDBPyConnection, path: Path) -> None:
        self.path = path
        self.connection = connection  # for the functions of this folder
        self._in_transaction = False
        self._reads_files = False

    @classmethod
    def open_with_files(cls, path: Path) -> Store:
        """Open a database for questions that may also read other files, such as a user's own CSV.

        Raises:
            StoreError: as `open`.
        """
        store = cls(connect(path, read_only=True, files=True), path)
        store._reads_files = True
        return store

    @classmethod
    def open(cls, path: Path, *, read_only: bool = False, roomy: bool = False) -> Store:
        """Open a database, and create it if it is to be written and does not exist.

        No connection can reach any other file; one that only reads cannot change the database. One
        that writes keeps its memory small, unless it is to be `roomy` for large reads as well.

        Raises:
            StoreError: it does not exist, is none, is of another version, or is held by another
                process.
        """
        store = cls(connect(path, read_only=read_only, roomy=roomy), path)
        if not read_only:
            try:
                store.prepare()
            except BaseException:
                store.connection.close()
                raise
        return store

    @classmethod
    def hold(cls, path: Path, *, roomy: bool = False) -> Store:
        """Take hold of a database for writing, as `open`; until `prepare` it may have no tables."""
        return cls(connect(path, read_only=False, roomy=roomy), path)

    def prepare(self, views: Collection[str] = ()) -> None:
        """Make the tables and views of this version, or of these only some, if they are missing."""
        with self.transaction():
            apply_schema(self.connection, views)

    @classmethod
    def open_current(cls, path: Path) -> Store:
        """Open a database for reading, its tables and views brought up to date if they are older.

        Raises:
            StoreError: as `open`; or it is older, and held by another process.
        """
        store = cls.open(path, read_only=True)
        if not is_current(store.connection):
            store.connection.close()
            cls.open(path, roomy=True).connection.close()
            store = cls.open(path, read_only=True)
        return store

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.connection.close()

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """All or nothing: commit at the end, roll back on any error.

        Raises:
            DiskRefused: the disk refused (it is full, for one); nothing of it was kept.
            StoreError: the database takes no more, by an error inside DuckDB; nothing of it was kept.
            RowsRefused: the database does not take these rows; nothing of it was kept.
        """
        if self._in_transaction:
            raise RuntimeError("transactions do not nest")
        self.connection.execute("BEGIN")
        self._in_transaction = True
        try:
            yield
            # After a fatal error COMMIT rolls back without saying so; any statement says so.
            self.connection.execute("SELECT 1")
            self.connection.execute("COMMIT")
        except BaseException as error:
            # A failed COMMIT has ended the transaction already.
            with suppress(duckdb.Error):
                self.connection.execute("ROLLBACK")
            of_the_disk = isinstance(error, duckdb.IOException) or _is_of_the_disk(error)
            if isinstance(error, _OF_THE_DATABASE) or of_the_disk:
                text = f"nothing of this step was stored: {error}"
                if not of_the_disk:
                    raise StoreError(text, where=Where(self.path)) from error
                raise DiskRefused(
                    text,
                    where=Where(self.path),
                    remedy="Free some disk space if it is full, then run the same command again",
                ) from error
            if isinstance(error, duckdb.Error):
                raise RowsRefused(
                    f"nothing of this step was stored, the database does not take its rows: {error}",
                    where=Where(self.path),
                ) from error
            raise
        finally:
            self._in_transaction = False

    @contextmanager
    def incoming(self, name: str, rows: pa.Table | pa.RecordBatchReader) -> Iterator[None]:
        """Let SQL see Arrow rows under a name.

        A table is held until the transaction ends; a reader that was read holds nothing.
        """
        self.connection.register(name, rows)
        try:
            yield
        finally:
            with suppress(duckdb.Error):  # after an error, which is what is to be told
                self.connection.unregister(name)

    def read(self, table: str, recording_id: str) -> pa.Table:
        """Return a recording's rows of a table, by camera and time (estimates by method)."""
        if table not in RECORDING_TABLES:
            raise ValueError(f"{table!r} is no table of recordings")
        order = ROW_ORDER.get(table, "ALL")
        return self.connection.sql(
            f"SELECT * FROM {table} WHERE recording_id = ? ORDER BY {order}",  # noqa: S608  (ours)
            params=[recording_id],
        ).to_arrow_table()

    def query(self, sql: str, parameters: Sequence[object] | Mapping[str, object] = ()) -> pa.Table:
        """Return the result of one statement that a user wrote; it cannot change anything.

        Ask a store that is open for reading when there are millions of rows: one that is open for
        writing keeps its memory small (`connection.WRITING_MEMORY`), and exact medians need it.

        Each `?` in it stands for a parameter, or each `$name` for one of a mapping.

        Raises:
            UsageError: DuckDB does not accept it, or it is not one statement.
        """
        cursor = self.connection.cursor()
        try:
            statements = cursor.extract_statements(sql)
            if len(statements) != 1:
                raise UsageError("one SQL statement is needed", remedy="Run them one by one")
            if self._reads_files and statements[0].type != duckdb.StatementType.SELECT:
                raise UsageError("with files of your own, a question is one SELECT")
            if statements[0].type in _WRITING_FILES:
                raise UsageError("a question writes no file", remedy="`--parquet FILE` does")
            cursor.execute("BEGIN TRANSACTION READ ONLY")
            values = dict(parameters) if isinstance(parameters, Mapping) else list(parameters)
            relation = cursor.sql(sql, params=values or None)
            if relation is None:
                raise UsageError("the statement has no rows to show", remedy="Give a SELECT")
            return relation.to_arrow_table()
        except duckdb.Error as error:
            raise UsageError(f"DuckDB: {error}", remedy=self._hint(str(error))) from error
        finally:
            cursor.close()

    def _hint(self, error: str) -> str:
        """Return what to do about an error of DuckDB: the name that was meant, or where names are."""
        listed = "`stadimeter query --list` shows tables and views"
        missing = re.search(r"(?:Table|View) with name (\S+) does not exist", error)
        meant = like(missing[1], [view.name for view in self.views()]) if missing else ""
        if "there is no run" in error:
            return "`stadimeter runs` lists runs and labels"
        if not meant and "disabled" in error:
            return "`query --allow-files` lets a question read your own CSV and Parquet files"
        return f"Did you mean {meant}? {listed}" if meant else listed

    def views(self) -> list[View]:
        """Return tables, views and table macros, with comments and columns."""
        return views(self.connection)

    def catalog(self) -> pa.Table:
        """Return name and comment of tables, views and table macros."""
        found = self.views()
        return pa.table({"name": [v.name for v in found], "comment": [v.comment for v in found]})


def _is_of_the_disk(error: BaseException) -> bool:
    return isinstance(error, duckdb.Error) and any(text in str(error) for text in _REFUSALS)


def read_once(rows: pa.Table) -> pa.RecordBatchReader:
    """Return rows as a reader, which holds nothing when it was read (`Store.incoming`)."""
    return pa.RecordBatchReader.from_batches(rows.schema, iter(rows.to_batches()))
