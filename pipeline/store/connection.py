"""Opening a database file, with a plain reason if it cannot be opened.

No connection reaches any other file or the network: what comes in comes as Arrow. So nothing that a
user puts into `stadimeter query` can read or write beside the database.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import duckdb
import pyarrow as pa

from pipeline.core.errors import StoreError, Where
from pipeline.store.schema import SCHEMA_VERSION

# A run's memory is to stay flat, so no statement of it may ask for all of a recording at once; a day has
# been taken in and estimated with this. Readers take what they need.
WRITING_MEMORY = "64MB"
WRITING_THREADS = 4  # each wants a share of the memory, and there is little for many to do
# New files are of the format that DuckDB has written since 1.2, which the command line and the libraries
# that people have can open; a file that is there keeps its own.
_STORAGE = {"storage_compatibility_version": "v1.2.0"}
CONFIG = {
    "autoinstall_known_extensions": "false",
    "autoload_known_extensions": "false",
    "enable_external_access": "false",
    "python_enable_replacements": "false",
    "lock_configuration": "true",
}


def connect(
    path: Path, *, read_only: bool, roomy: bool = False, files: bool = False
) -> duckdb.DuckDBPyConnection:
    """Open a stadimeter database; a missing one is created, empty, if it is to be written.

    Who writes and also reads much at once (a timeline, a calibration) wants it `roomy`. With `files`,
    statements can reach other files; extensions, and with them the network, stay out.

    Raises:
        StoreError: there is none, it is something else or of another version, or it is held.
    """
    where = Where(path)
    if path.exists() and not path.is_file():
        raise StoreError("is no file, but a folder or a device", where=where, remedy=_ANOTHER)
    if read_only and (not path.is_file() or path.stat().st_size == 0):
        raise StoreError("there is no such database", where=where, remedy=_MAKE_ONE)
    try:
        if not read_only:
            # Arrow's own allocator keeps what it ever had, 100 MB; the system's gives it back.
            pa.set_memory_pool(pa.system_memory_pool())
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.is_file() and path.stat().st_size == 0:
                path.unlink()  # what a killed run or `touch` leaves is a new database
        small = not read_only and not roomy
        config = CONFIG | (_small() if small else {}) | ({} if read_only else _STORAGE)
        config |= {"enable_external_access": "true"} if files else {}
        connection = duckdb.connect(str(path), read_only=read_only, config=config)
    except (duckdb.Error, OSError) as error:
        raise _explained(str(error), where) from error
    try:
        _refuse_foreign(connection, where, read_only=read_only)
    except duckdb.Error as error:
        connection.close()
        raise _explained(str(error), where) from error
    except StoreError:
        connection.close()
        raise
    return connection


def _small() -> dict[str, str]:
    threads = min(os.cpu_count() or 1, WRITING_THREADS)
    return {"memory_limit": WRITING_MEMORY, "threads": str(threads)}


_MAKE_ONE = "`stadimeter run` makes one"
_ANOTHER = "Give another --db"


def _explained(text: str, where: Where) -> StoreError:
    if "Conflicting lock" in text or "Could not set lock" in text:
        holder = re.search(r"held in (.+?) \(PID (\d+)\)", text)
        who = f"process {holder[2]} ({holder[1]})" if holder else "another process"
        return StoreError(
            f"{who} has the database open",
            where=where,
            remedy="Wait until it ends, or end it; many processes can read, but only one can write",
        )
    if "different configuration" in text:
        return StoreError(
            "is already open in this process, for reading or for writing; it cannot be opened for both",
            where=where,
            remedy="Close it first",
        )
    if "not a valid DuckDB database" in text:
        return StoreError("is not a DuckDB database", where=where, remedy=_ANOTHER)
    if "version number" in text:
        return StoreError(
            f"was written by another version of DuckDB: {_first_line(text)}",
            where=where,
            remedy=f"{_ANOTHER}, or read it with the version that wrote it",
        )
    if "Corrupt" in text or "checksum" in text:
        return StoreError(
            f"is damaged: {_first_line(text)}",
            where=where,
            remedy="Run the recordings again into a new database",
        )
    return StoreError(f"cannot be opened: {_first_line(text)}", where=where, remedy=_ANOTHER)


def _first_line(text: str) -> str:
    return text.strip().splitlines()[0].rstrip(".!")


def _refuse_foreign(
    connection: duckdb.DuckDBPyConnection, where: Where, *, read_only: bool
) -> None:
    tables = {
        name
        for (name,) in connection.execute(
            "SELECT table_name FROM duckdb_tables() WHERE NOT internal"
        ).fetchall()
    }
    if not tables and not read_only:
        return
    if "schema_version" not in tables:
        raise StoreError("is no stadimeter database", where=where, remedy=_ANOTHER)
    found = connection.execute("SELECT version FROM schema_version LIMIT 1").fetchall()
    if found != [(SCHEMA_VERSION,)]:
        version = found[0][0] if found else "unknown"
        raise StoreError(
            f"has tables of version {version}; this stadimeter has version {SCHEMA_VERSION}",
            where=where,
            remedy=f"{_ANOTHER}; the recordings can be run again into a new one",
        )
