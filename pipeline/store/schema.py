"""Applying `schemas/sql`: tables once, macros and views at every opening for writing."""

from __future__ import annotations

import csv
from importlib.resources import files
from importlib.resources.abc import Traversable

import duckdb

# Raised when tables change in a way that an older database cannot be read with.
SCHEMA_VERSION = 1


def apply_schema(connection: duckdb.DuckDBPyConnection) -> None:
    """Create what is missing of the tables, and the macros and views anew."""
    sql = files("schemas") / "sql"
    connection.execute("CREATE TABLE IF NOT EXISTS schema_version (version INTEGER NOT NULL)")
    connection.execute(
        "COMMENT ON TABLE schema_version IS 'The version of these tables; one row.';"
        "COMMENT ON COLUMN schema_version.version IS 'Rises when tables change.'"
    )
    connection.execute(
        "INSERT INTO schema_version SELECT ? WHERE NOT EXISTS (FROM schema_version)",
        [SCHEMA_VERSION],
    )
    connection.execute((sql / "tables.sql").read_text())
    connection.execute("CREATE SCHEMA IF NOT EXISTS accuracy")
    connection.execute("CREATE SCHEMA IF NOT EXISTS paper")
    connection.execute((sql / "macros.sql").read_text())
    for view in view_files():
        connection.execute(view.read_text())
    _comment_view_columns(connection)


def view_files() -> list[Traversable]:
    """Return the views' files in the order of `schemas/sql/views/ORDER`: what is used comes first."""
    folder = files("schemas") / "sql" / "views"
    order = (folder / "ORDER").read_text().split()
    return [folder / f"{name}.sql" for name in order]


def _comment_view_columns(connection: duckdb.DuckDBPyConnection) -> None:
    """Give the columns of views the comments of their names: the tables', or `columns.csv`'s.

    One name is one thing everywhere, so its explanation is written once.
    """
    with (files("schemas") / "sql" / "columns.csv").open(encoding="utf-8", newline="") as lines:
        glossary = {row["name"]: row["comment"] for row in csv.DictReader(lines)}
    columns = connection.execute(
        "SELECT schema_name, table_name, column_name, comment FROM duckdb_columns() "
        "WHERE NOT internal"
    ).fetchall()
    glossary |= {name: comment for _, _, name, comment in columns if comment is not None}
    views = connection.execute(
        "SELECT schema_name, view_name FROM duckdb_views() WHERE NOT internal"
    ).fetchall()
    for schema, table, name, _ in columns:
        if (schema, table) in set(views) and name in glossary:
            comment = glossary[name].replace("'", "''")  # our own text: DDL takes no parameters
            connection.execute(f"COMMENT ON COLUMN {schema}.{table}.{name} IS '{comment}'")
