"""Questions of a user: own files, names with a slip, and a file that other versions can open."""

from __future__ import annotations

import io
import json
from decimal import Decimal
from pathlib import Path

import duckdb
import pyarrow as pa
import pytest

import stadimeter
from pipeline.cli.query import write_json
from pipeline.core.errors import UsageError
from pipeline.store.database import Store


@pytest.fixture
def database(tmp_path: Path) -> Path:
    path = tmp_path / "d.duckdb"
    Store.open(path).connection.close()
    return path


def test_a_new_file_has_the_format_that_others_open(database: Path) -> None:
    with duckdb.connect(str(database), read_only=True) as connection:
        ((tags,),) = connection.execute("SELECT tags FROM duckdb_databases() LIMIT 1").fetchall()
    assert str(tags["storage_version"]).startswith("v1.2")


def test_own_files_are_read_only_where_they_are_allowed(database: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.csv"
    mine.write_text("track_id,name\n1,Ada\n2,Grace\n")
    question = f"SELECT name FROM '{mine}' LEFT JOIN track_heights USING (track_id) ORDER BY 1"
    with stadimeter.open(database) as results, pytest.raises(UsageError, match="--allow-files"):
        results.query(question)
    with stadimeter.open(database, allow_files=True) as results:
        assert results.query(question).arrow().column(0).to_pylist() == ["Ada", "Grace"]
        target = tmp_path / "out.csv"
        for statement in (
            f"COPY (SELECT 1) TO '{target}'",
            f"ATTACH '{tmp_path / 'x.duckdb'}'",
            "INSTALL httpfs",
            "CREATE TABLE t (a INTEGER)",
        ):
            with pytest.raises(UsageError):
                results.query(statement)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["d.duckdb", "mine.csv"]


def test_a_name_without_its_schema_or_with_a_slip_is_understood(database: Path) -> None:
    with stadimeter.open(database) as results:
        for name, meant in (("by_method", "accuracy.by_method"), ("trak_heights", "track_heights")):
            with pytest.raises(UsageError, match=f"Did you mean {meant}"):
                results.query(f"FROM {name}")
            with pytest.raises(UsageError, match=f"Did you mean {meant}"):
                results.view(name)


def test_sums_are_numbers_in_json() -> None:
    rows = pa.table({"n": [Decimal("12")], "d": [Decimal("1.50")], "l": [[float("nan"), 1.0]]})
    text = io.StringIO()
    write_json(rows, text)
    assert json.loads(text.getvalue()) == {"n": 12, "d": 1.5, "l": [None, 1.0]}
