"""`stadimeter query`: answers from the database, read-only, as a table, CSV, JSON or Parquet."""

from __future__ import annotations

import argparse
import json
import math
import sys
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from pipeline.cli.console import out, print_table, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database
from pipeline.core.errors import UsageError
from pipeline.core.files import whole_file

if TYPE_CHECKING:
    import pyarrow as pa


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser("query", help="ask the database in SQL; it cannot be changed")
    parser.add_argument("sql", nargs="?", metavar="SQL")
    add_database(parser)
    parser.add_argument("--parts", type=Path, metavar="DIR", help="ask a folder of `run --parts`")
    parser.add_argument("--view", metavar="NAME", help="all rows of a view or table")
    parser.add_argument("--list", action="store_true", help="tables and views, what they answer")
    parser.add_argument(
        "--allow-files",
        action="store_true",
        help="let the question read your own files: JOIN 'mine.csv' (default: the database only)",
    )
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--csv", action="store_true", help="a line for each row, with a header")
    form.add_argument("--json", action="store_true", help="a JSON object for each row")
    form.add_argument("--parquet", type=Path, metavar="FILE", help="write a Parquet file")
    form.add_argument("--table", action="store_true", help="a grid, however wide the rows are")
    form.add_argument(
        "--records",
        action="store_true",
        help="a block of lines for each row (default on a terminal: for a few rows that are too wide)",
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    if sum((arguments.sql is not None, arguments.view is not None, arguments.list)) != 1:
        raise UsageError("give one of SQL, --view NAME or --list")
    table = answer(
        arguments.db, arguments.sql, arguments.view, arguments.parts, arguments.allow_files
    )
    if arguments.csv:
        write_csv(table, sys.stdout)
    elif arguments.json:
        write_json(table, sys.stdout)
    elif arguments.parquet:
        write_parquet(table, arguments.parquet)
        out.print(f"{safe(arguments.parquet)}: {table.num_rows:,} rows")
    else:
        chosen = {(True, False): True, (False, True): False}
        print_table(table, records=chosen.get((arguments.records, arguments.table)))
    return DONE


def answer(
    database: Path,
    sql: str | None,
    view: str | None,
    parts: Path | None = None,
    allow_files: bool = False,
) -> pa.Table:
    """Return the result of a statement, all rows of a view, or, without either, the catalogue.

    The database is asked, or a folder of finished recordings if one is given.

    Raises:
        StoreError: the database cannot be opened.
        UsageError: DuckDB does not accept the statement, or there is no such view.
    """
    import stadimeter

    with stadimeter.open(database if parts is None else parts, allow_files=allow_files) as results:
        if sql is not None:
            return results.query(sql).arrow()
        return (results.catalog() if view is None else results.view(view)).arrow()


def write_csv(table: pa.Table, stream: TextIO) -> None:
    """Write a header line and a line for each row; nothing for NULL."""
    import pyarrow as pa
    import pyarrow.csv

    nested = [i for i, f in enumerate(table.schema) if pa.types.is_nested(f.type)]
    for index in nested:  # CSV has no lists
        texts = [None if v is None else json.dumps(v) for v in table.column(index).to_pylist()]
        table = table.set_column(
            index, table.schema.field(index).name, pa.array(texts, pa.string())
        )
    sink = pa.BufferOutputStream()
    pa.csv.write_csv(table, sink)
    stream.write(sink.getvalue().to_pybytes().decode())


def write_json(table: pa.Table, stream: TextIO) -> None:
    """Write one JSON object a line; times as ISO 8601; what JSON cannot hold as null."""
    for row in table.to_pylist():
        stream.write(json.dumps({k: _plain(v) for k, v in row.items()}, default=str) + "\n")


def _plain(value: object) -> object:
    """Return a value as JSON has it, lists and structures with all that is in them."""
    if isinstance(value, Decimal):  # sums of whole numbers, too
        return int(value) if value == value.to_integral_value() else float(value)
    if isinstance(value, list):
        return [_plain(one) for one in value]
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_parquet(table: pa.Table, path: Path) -> None:
    """Write a Parquet file.

    Raises:
        StadimeterError: the file cannot be written.
    """
    import pyarrow.parquet as pq

    with whole_file(path, "the table") as part:
        pq.write_table(table, part)
