"""Bringing the tables of an older database up to date: columns that came later are added, unknown.

What was stored stays as it was: a column that did not exist was not measured, so it is NULL, and a
recording that is run again fills it.
"""

from __future__ import annotations

import re
from collections.abc import Collection

import duckdb

_CREATE = re.compile(r"CREATE TABLE IF NOT EXISTS .*?;", re.DOTALL)
_COLUMNS = """
SELECT table_name, column_name, data_type FROM duckdb_columns()
WHERE NOT internal AND schema_name = ? ORDER BY table_name, column_index
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


def mirror_tables(connection: duckdb.DuckDBPyConnection, tables: Collection[str]) -> None:
    """Give each table one of the same columns in the schema `kept`, with `measured_by` before them.

    Older ones get the columns that they lack, and types that changed.
    """
    connection.execute("CREATE SCHEMA IF NOT EXISTS kept")
    wanted, found = _columns(connection), _columns(connection, "kept")
    for table in tables:
        columns = {"measured_by": "VARCHAR"} | wanted[table]
        listed = ", ".join(f"{name} {kind}" for name, kind in columns.items())
        connection.execute(f"CREATE TABLE IF NOT EXISTS kept.{table} ({listed})")
        for name, kind in columns.items():
            there = found.get(table, columns).get(name)
            if there is None:
                connection.execute(f"ALTER TABLE kept.{table} ADD COLUMN {name} {kind}")
            elif there != kind:
                connection.execute(f"ALTER TABLE kept.{table} ALTER {name} SET DATA TYPE {kind}")
        connection.execute(
            f"COMMENT ON TABLE kept.{table} IS 'Rows of main.{table} of measurements that are "
            "kept beside the current one.'"
        )


def _wanted(tables_sql: str) -> dict[str, dict[str, str]]:
    with duckdb.connect() as scratch:
        for statement in _CREATE.findall(tables_sql):
            scratch.execute(statement)
        return _columns(scratch)


def _columns(
    connection: duckdb.DuckDBPyConnection, schema: str = "main"
) -> dict[str, dict[str, str]]:
    tables: dict[str, dict[str, str]] = {}
    for table, column, kind in connection.execute(_COLUMNS, [schema]).fetchall():
        tables.setdefault(table, {})[column] = kind
    return tables
