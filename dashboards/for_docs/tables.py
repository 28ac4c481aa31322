"""Dictionary of the tables and views of the database, generated from the comments in the SQL.

python -m dashboards.for_docs.tables docs/tables.md     # or: make docs
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import duckdb

from pipeline.store.catalog import View, views
from pipeline.store.schema import apply_schema

HEAD = """# Tables and views

Generated from the comments in `schemas/sql` by `make docs`; do not edit it here. Every database has the
same texts: `stadimeter query --db FILE --list` prints them.

Unknown is NULL, never zero. A name ends in its unit. `_std` is one standard deviation. Pixels are those
of the stored picture, with the centre of the first one at (0, 0).
"""
MACROS = """## Table macros

A table macro is called in the FROM clause: `FROM accuracy.by_range_bins([0, 5, 10, 20, 40])`.
"""
WORDS = """## Shared columns

Columns that several views have. One name has one meaning in every table and view.
"""

_TYPES = """
SELECT table_name, list(data_type ORDER BY column_index)
FROM duckdb_columns() WHERE NOT internal AND schema_name = 'main' GROUP BY table_name
"""


def dictionary() -> str:
    """Return the Markdown text of the dictionary, from an empty database in memory."""
    with duckdb.connect() as connection:
        apply_schema(connection)
        found = views(connection)
        made = connection.execute("SELECT table_name FROM duckdb_tables()").fetchall()
        types = dict(connection.execute(_TYPES).fetchall())
        words = connection.execute("FROM main.glossary").fetchall()
    tables = {name for (name,) in made}
    shared = dict(words)
    parts = [HEAD, "## Tables\n"]
    parts += [_table(v, types[v.name]) for v in found if v.name in tables]
    parts.append("## Views\n")
    parts += [_view(v, shared) for v in found if v.name not in tables and "(" not in v.name]
    parts.append(MACROS)
    parts += [f"### `{v.name}`\n\n{_escaped(v.comment)}\n" for v in found if "(" in v.name]
    parts.append(WORDS)
    parts.append(_grid(("column", "meaning"), [(f"`{name}`", text) for name, text in words]))
    return "\n".join(parts)


def _table(table: View, types: Sequence[str]) -> str:
    """Return a table with the type and meaning of each column."""
    rows = [
        (f"`{name}`", kind.lower(), comment or "")
        for name, kind, comment in zip(table.columns, types, table.column_comments, strict=True)
    ]
    grid = _grid(("column", "type", "meaning"), rows)
    return f"### `{table.name}`\n\n{_escaped(table.comment)}\n\n{grid}"


def _view(view: View, shared: dict[str, str]) -> str:
    """Return a view with its columns, and the meaning of those that have one of their own."""
    own = [
        (f"`{name}`", comment or "")
        for name, comment in zip(view.columns, view.column_comments, strict=True)
        if comment != shared.get(name)
    ]
    text = f"### `{view.name}`\n\n{_escaped(view.comment)}\n\n"
    text += f"Columns: {', '.join(f'`{name}`' for name in view.columns)}.\n"
    return f"{text}\n{_grid(('column', 'meaning'), own)}" if own else text


def _grid(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(_escaped(cell) for cell in row)} |\n" for row in cells)


def _escaped(text: str) -> str:
    """Return text in which Markdown sees neither a table's border nor emphasis."""
    return text.replace("|", "\\|").replace("*", "\\*")


def main() -> int:
    """Write the dictionary."""
    parser = argparse.ArgumentParser(description="Write the dictionary of tables and views.")
    parser.add_argument("target", type=Path, help="the Markdown file to write")
    parser.parse_args().target.write_text(dictionary(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
