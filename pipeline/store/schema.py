"""Applying `schemas/sql`: tables once; functions and views again when their text has changed."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Mapping
from functools import cache
from graphlib import TopologicalSorter
from importlib.resources import files
from importlib.resources.abc import Traversable

import duckdb

from pipeline.store.columns import RECORDING_TABLES
from pipeline.store.upgrade import mirror_tables, upgrade_tables

# Raised when tables change in a way that `upgrade_tables` cannot bring about; new tables and columns
# need no new version.
SCHEMA_VERSION = 3

_PARTIAL = "some of the views, "  # before the hash: whoever opens it makes the others
_VERSION_TABLE = """
CREATE TABLE IF NOT EXISTS schema_version (version INTEGER NOT NULL, sql_sha256 VARCHAR NOT NULL);
COMMENT ON TABLE schema_version IS 'One row: which tables and views this database has.';
COMMENT ON COLUMN schema_version.version IS 'Rises when tables change.';
COMMENT ON COLUMN schema_version.sql_sha256 IS 'Hash of the SQL that made the tables and views.';
"""


def apply_schema(connection: duckdb.DuckDBPyConnection, only: Collection[str] = ()) -> None:
    """Create or alter tables that differ from this version's, and make views anew if any text differs.

    Args:
        connection: to a database, which may be empty.
        only: the views that it is to have, with those that they need; none named is all.
    """
    connection.execute(_VERSION_TABLE)
    if is_current(connection):
        return
    tables, functions = _first_scripts()
    wanted = _with_needed(only)
    upgrade_tables(connection, tables)
    connection.execute(tables)
    if not only:
        mirror_tables(connection, RECORDING_TABLES)
    connection.execute(functions)
    for name, script in view_scripts():
        if not only or name in wanted:
            connection.execute(script)
    if not only:
        _comment_view_columns(connection, re.findall(r"CREATE TABLE IF NOT EXISTS (\w+)", tables))
    connection.execute("DELETE FROM schema_version")
    digest = (_PARTIAL if only else "") + _digest()
    connection.execute("INSERT INTO schema_version VALUES (?, ?)", [SCHEMA_VERSION, digest])


def is_current(connection: duckdb.DuckDBPyConnection) -> bool:
    """Return true if the tables and views of a database are those of this version."""
    return _made(connection) == _digest()


def _made(connection: duckdb.DuckDBPyConnection) -> str | None:
    """Return the hash of the SQL that made the tables and views."""
    # All of it is fetched: while a result is open the connection takes no other statement.
    found = connection.execute("SELECT sql_sha256 FROM schema_version").fetchall()
    return str(found[0][0]) if len(found) == 1 else None


@cache
def _digest() -> str:
    return hashlib.sha256("\n".join([_VERSION_TABLE, *_scripts()]).encode()).hexdigest()


def _scripts() -> list[str]:
    """Return the SQL of tables, functions and views, in the order in which it is run."""
    return [*_first_scripts(), *(script for _, script in view_scripts())]


def _first_scripts() -> list[str]:
    sql = files("schemas") / "sql"
    return [(sql / name).read_text() for name in ("tables.sql", "functions.sql")]


def view_scripts() -> list[tuple[str, str]]:
    """Return name and text of the views' files, each after those that it mentions, in one order."""
    scripts = _view_files()
    needed = {name: sorted(others) for name, others in sorted(_needed(scripts).items())}
    return [(name, scripts[name]) for name in TopologicalSorter(needed).static_order()]


def _view_files() -> dict[str, str]:
    return {path.name.removesuffix(".sql"): path.read_text() for path in _sql_files("views")}


def _needed(scripts: Mapping[str, str]) -> dict[str, set[str]]:
    """Return, by view, the other views that it mentions."""
    return {
        name: {other for other in _mentioned(script) if other in scripts and other != name}
        for name, script in scripts.items()
    }


def _with_needed(names: Collection[str]) -> set[str]:
    """Return views with all that they need."""
    needed, found, open_ = _needed(_view_files()), set[str](), list(names)
    while open_:
        name = open_.pop()
        if name not in found:
            found.add(name)
            open_ += needed[name]
    return found


def _sql_files(folder: str) -> list[Traversable]:
    found = (files("schemas") / "sql" / folder).iterdir()
    return sorted((p for p in found if p.name.endswith(".sql")), key=lambda p: p.name)


def _mentioned(script: str) -> set[str]:
    """Return the qualified names in a script, those in comments and texts left out."""
    code = re.sub(r"'(?:[^']|'')*'|--[^\n]*", "", script)
    return set(re.findall(r"\b(?:main|accuracy|paper)\.\w+", code))


def _comment_view_columns(connection: duckdb.DuckDBPyConnection, tables: list[str]) -> None:
    """Give columns of views that have no comment the comment of their name.

    One name is one thing everywhere, so its explanation is written once: at a table's column (of
    several, that of the table which tables.sql makes first), or in the view main.glossary.
    """
    bare = connection.execute(
        """
        WITH columns AS (
            SELECT schema_name, table_name, column_name, comment
            FROM duckdb_columns()
            WHERE NOT internal
        ),
        meanings AS (
            SELECT column_name, meaning FROM main.glossary
            UNION ALL
            SELECT column_name, first(comment ORDER BY list_position($tables, table_name))
            FROM columns
            WHERE schema_name = 'main' AND list_contains($tables, table_name)
                AND column_name NOT IN (SELECT column_name FROM main.glossary)
            GROUP BY column_name
        )
        SELECT schema_name, table_name, column_name, meaning
        FROM columns JOIN meanings USING (column_name)
        WHERE comment IS NULL AND meaning IS NOT NULL
        """,
        {"tables": tables},
    ).fetchall()
    for schema, view, column, meaning in bare:
        text = meaning.replace("'", "''")  # our own text: DDL takes no parameters
        connection.execute(f"COMMENT ON COLUMN {schema}.{view}.{column} IS '{text}'")
