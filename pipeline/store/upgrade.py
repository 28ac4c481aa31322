"""Bringing the tables of an older database up to date: columns that came later are added, unknown.

What was stored stays as it was: a column that did not exist was not measured, so it is NULL, and a
recording that is run again fills it.
"""

from __future__ import annotations

import re

import duckdb

_CREATE = re.compile(r"CREATE TABLE IF NOT EXISTS .*?;", re.DOTALL)
_COLUMNS = """
SELECT table_name, column_name, data_type FROM duckdb_columns()
WHERE NOT internal AND schema_name = 'main' ORDER BY table_name, column_index
"""


def upgrade_tables(connection: duckdb.DuckDBPyConnection, tables_sql: str) -> None:
    """Alter the tables that there are to those of `tables_sql`, inside the caller's transaction.

    Columns that are missing are added, types that changed are converted, and columns that went are
    kept. Tables that are missing altogether are left to `tables_sql` itself.
    """
    found = _columns(connection)
    for table, columns in _wanted(tables_sql).items():
        if table not in found:
            continue
        for name, kind in columns.items():
            # Names and types are those of our own files.
            if name not in found[table]:
                connection.execute(f"ALTER TABLE {table} ADD COLUMN {name} {kind}")
            elif found[table][name] != kind:
                connection.execute(f"ALTER TABLE {table} ALTER COLUMN {name} SET DATA TYPE {kind}")


def _wanted(tables_sql: str) -> dict[str, dict[str, str]]:
    with duckdb.connect() as scratch:
        for statement in _CREATE.findall(tables_sql):
            scratch.execute(statement)
        return _columns(scratch)


def _columns(connection: duckdb.DuckDBPyConnection) -> dict[str, dict[str, str]]:
    tables: dict[str, dict[str, str]] = {}
    for table, column, kind in connection.execute(_COLUMNS).fetchall():
        tables.setdefault(table, {})[column] = kind
    return tables
