from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import duckdb
import pytest

from pipeline.core.errors import StoreError
from pipeline.store.database import Store
from pipeline.store.recordings import list_recordings


def test_reading_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match=r"no such database.*stadimeter run"):
        Store.open(tmp_path / "none.duckdb", read_only=True)
    assert not (tmp_path / "none.duckdb").exists()


@pytest.mark.parametrize("content", [b"he", b"not a database" * 1000])
@pytest.mark.parametrize("read_only", [True, False])
def test_a_file_of_another_kind(tmp_path: Path, content: bytes, read_only: bool) -> None:
    path = tmp_path / "a.duckdb"
    path.write_bytes(content)
    with pytest.raises(StoreError, match="is not a DuckDB database"):
        Store.open(path, read_only=read_only)
    assert path.read_bytes() == content


def test_an_empty_file_is_a_new_database(tmp_path: Path) -> None:
    path = tmp_path / "a.duckdb"
    path.touch()
    with pytest.raises(StoreError, match="no such database"):
        Store.open(path, read_only=True)
    with Store.open(path) as store:
        assert list_recordings(store).num_rows == 0


def test_a_folder_is_no_database(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="is no file, but a folder"):
        Store.open(tmp_path)


def test_a_parent_that_is_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError):
        Store.open(tmp_path / "file" / "a.duckdb")


@pytest.mark.parametrize("read_only", [True, False])
def test_somebody_elses_database_is_left_alone(tmp_path: Path, read_only: bool) -> None:
    path = tmp_path / "a.duckdb"
    with duckdb.connect(str(path)) as connection:
        connection.execute("CREATE TABLE runs (mine INTEGER)")
    with pytest.raises(StoreError, match="no stadimeter database"):
        Store.open(path, read_only=read_only)
    with duckdb.connect(str(path)) as connection:
        assert connection.execute("SELECT count(*) FROM duckdb_tables()").fetchone() == (1,)


@pytest.mark.parametrize("read_only", [True, False])
def test_another_version_of_the_tables(path: Path, read_only: bool) -> None:
    with duckdb.connect(str(path)) as connection:
        connection.execute("UPDATE schema_version SET version = 999")
    with pytest.raises(StoreError, match="tables of version 999"):
        Store.open(path, read_only=read_only)


def test_damage_is_named(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[4096:12288] = os.urandom(8192)
    path.write_bytes(data)
    with pytest.raises(StoreError, match=str(path)):
        Store.open(path)


@pytest.mark.parametrize("read_only", [True, False])
def test_a_database_in_use_names_the_user(path: Path, read_only: bool) -> None:
    holder = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import sys, duckdb; c = duckdb.connect(sys.argv[1]); print('open', flush=True);"
            "sys.stdin.read()",
            str(path),
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "open\n"
        with pytest.raises(StoreError, match=f"process {holder.pid}.*has the database open"):
            Store.open(path, read_only=read_only)
    finally:
        holder.communicate("")
    Store.open(path, read_only=read_only).__exit__(None, None, None)


def test_a_missing_folder_is_made(tmp_path: Path) -> None:
    with Store.open(tmp_path / "deep" / "er" / "a.duckdb") as store:
        assert list_recordings(store).num_rows == 0


def test_one_process_does_not_read_and_write_at_once(path: Path) -> None:
    with Store.open(path), pytest.raises(StoreError, match="open in this process"):
        Store.open(path, read_only=True)


def test_readers_share(path: Path) -> None:
    with Store.open(path, read_only=True) as one, Store.open(path, read_only=True) as two:
        assert one.catalog() == two.catalog()


def test_opening_again_changes_nothing(path: Path) -> None:
    with Store.open(path) as store:
        first = store.views()
    with Store.open(path) as store:
        assert store.views() == first


def test_a_changed_view_is_made_anew(path: Path) -> None:
    with duckdb.connect(str(path)) as connection:
        connection.execute("CREATE OR REPLACE VIEW accuracy.worst AS SELECT 1 AS old")
        connection.execute("UPDATE schema_version SET sql_sha256 = 'older'")
    with Store.open(path) as store:
        assert "old" not in store.query("FROM accuracy.worst").column_names


@pytest.mark.parametrize("roomy", [True, False])
def test_who_writes_keeps_its_memory_small_unless_it_also_reads_much(
    tmp_path: Path, roomy: bool
) -> None:
    with Store.open(tmp_path / "x.duckdb", roomy=roomy) as store:
        limit = store.query("SELECT current_setting('memory_limit') AS m")["m"][0].as_py()
    assert (limit == "61.0 MiB") is not roomy
