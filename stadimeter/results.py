"""Results of a database or a shared folder, as Arrow, pandas and DuckDB relations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from pipeline.core.errors import UsageError, Where
from stadimeter.arguments import PathLike

if TYPE_CHECKING:
    import duckdb
    import pandas as pd
    import pyarrow as pa

    from pipeline.store.database import Store


class Relation:
    """Rows of an answer. Units are in the names of the columns; unknown is NULL.

    They are kept as an Arrow table, so they stay after the database is closed.
    """

    def __init__(self, table: pa.Table) -> None:
        self._table = table

    def arrow(self) -> pa.Table:
        """Return the rows as an Arrow table."""
        return self._table

    def pandas(self) -> pd.DataFrame:
        """Return the rows as a data frame with Arrow types, in which unknown is `pd.NA`."""
        import pandas as pd

        frame: pd.DataFrame = self._table.to_pandas(types_mapper=pd.ArrowDtype)
        return frame

    def duckdb(
        self, connection: duckdb.DuckDBPyConnection | None = None
    ) -> duckdb.DuckDBPyRelation:
        """Return the rows as a DuckDB relation, of a connection or of one in memory."""
        import duckdb

        return (connection or duckdb.connect()).from_arrow(self._table)

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows as dictionaries, in which unknown is None."""
        found: list[dict[str, Any]] = self._table.to_pylist()
        return found

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self._table.column_names)

    def __len__(self) -> int:
        return int(self._table.num_rows)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Give the rows to any library that reads Arrow's C stream (Polars, DuckDB, pandas)."""
        return self._table.__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        return f"<Relation of {len(self):,} rows: {', '.join(self.columns)}>"


class Results:
    """A database, or a folder of `measure_parts`, open for questions; nothing in it can change.

    Use it as a context manager: while it is open, no other process can write to the database.
    """

    def __init__(self, store: Store) -> None:
        self._store = store

    @property
    def path(self) -> Path:
        """The database or folder."""
        return self._store.path

    def query(self, sql: str, parameters: Sequence[object] | Mapping[str, object] = ()) -> Relation:
        """Return the answer to one SQL statement.

        Args:
            sql: statement of DuckDB's SQL that reads.
            parameters: values of each `?`, or by name of each `$name`.

        Raises:
            UsageError: DuckDB does not accept it, or it is not one statement that reads.
        """
        return Relation(self._store.query(sql, parameters))

    def view(self, name: str) -> Relation:
        """Return all rows of a view or table, such as `accuracy.by_method` or `track_heights`.

        Raises:
            UsageError: there is none of that name.
        """
        known = name.removeprefix("main.")
        names = [view.name for view in self._store.views()]
        if known not in names:
            from pipeline.store.catalog import like

            meant = like(known, names)
            raise UsageError(
                f"there is no view or table {name!r}",
                where=Where(self.path),
                remedy=(f"Did you mean {meant}? " if meant else "")
                + "`stadimeter query --list` and `Results.catalog()` show them",
            )
        return self.query(f"FROM {known}")  # one of the catalogue's own names

    def catalog(self) -> Relation:
        """Return `name` and `comment` of all tables, views and table macros."""
        return Relation(self._store.catalog())

    def recordings(self) -> Relation:
        """Return a row for each stored recording."""
        return self.view("recordings")

    def close(self) -> None:
        """Close the database, so that others can write to it."""
        self._store.__exit__(None, None, None)

    def __enter__(self) -> Results:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Results in {self.path}>"


def open(db: PathLike, *, allow_files: bool = False) -> Results:
    """Open a database, or a folder that `measure_parts` wrote, for questions.

    Args:
        db: the database or folder.
        allow_files: let questions read other files: `FROM 'mine.csv'`. A database only.

    Raises:
        StoreError: there is none, it is of another version, or another process is writing to it.
    """
    from pipeline.store.database import Store

    path = Path(db)
    if allow_files:
        if path.is_dir():
            raise UsageError(
                "files can be read beside a database only, not beside a folder of parts"
            )
        return Results(Store.open_with_files(path))
    if path.is_dir():
        # Only here: it loads what measures, and a question to a database need not wait for that.
        from pipeline.cluster.results_folder import open_shared

        return Results(open_shared(path))
    return Results(Store.open(path, read_only=True))


def merge(parts: PathLike, db: PathLike) -> int:
    """Put all recordings of a folder that `measure_parts` wrote into a database.

    Returns:
        Number of recordings that were not there already.

    Raises:
        StoreError: a file is missing or was changed, or the database cannot be written.
    """
    from pipeline.cluster.results_folder import merge as take

    return take(Path(parts), Path(db))
