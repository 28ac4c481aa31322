"""Catalogue of tables, views and table macros with their comments."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import NamedTuple

import duckdb

_VIEWS = """
WITH relations AS (
    SELECT schema_name, table_name AS name, comment FROM duckdb_tables()
    WHERE NOT internal AND table_name <> 'schema_version' AND schema_name <> 'kept'
    UNION ALL
    SELECT schema_name, view_name, comment FROM duckdb_views() WHERE NOT internal
),
columns AS (
    SELECT
        schema_name, table_name AS name,
        list(column_name ORDER BY column_index) AS columns,
        list(comment ORDER BY column_index) AS column_comments
    FROM duckdb_columns()
    GROUP BY ALL
),
macros AS (
    SELECT
        schema_name, function_name || '(' || array_to_string(parameters, ', ') || ')' AS name,
        comment, parameters AS columns, list_transform(parameters, lambda p: NULL::VARCHAR)
    FROM duckdb_functions()
    WHERE NOT internal AND function_type = 'table_macro'
)
SELECT if(schema_name = 'main', name, schema_name || '.' || name), * EXCLUDE (schema_name, name)
FROM (FROM relations JOIN columns USING (schema_name, name) UNION ALL FROM macros)
ORDER BY schema_name <> 'main', schema_name, name
"""


class View(NamedTuple):
    """A table, view or table macro, and the question that it answers."""

    name: str  # with its schema, unless that is `main`; a macro's with its parameters
    comment: str
    columns: list[str]  # a macro's parameters
    column_comments: list[str | None]


def views(connection: duckdb.DuckDBPyConnection) -> list[View]:
    """Return tables, views and table macros: those of `main` first, then by name."""
    return [View(*row) for row in connection.execute(_VIEWS).fetchall()]


def like(name: str, names: Iterable[str]) -> str:
    """Return the name that one without its schema, or with a slip, stands for; empty if there is none."""
    known = [one.partition("(")[0] for one in names]
    wanted = name.lower().removeprefix("main.")
    bare = [one for one in known if one.rpartition(".")[2] == wanted.rpartition(".")[2]]
    return next(iter(bare or get_close_matches(wanted, known, n=1)), "")
