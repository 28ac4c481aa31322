"""Older databases are upgraded when they are written, and when report or timeline read them."""

from __future__ import annotations

from pathlib import Path

import duckdb
import pytest

from pipeline.core.records import Diagnostic, Severity
from pipeline.store.database import Store
from pipeline.store.recordings import add_diagnostics

NOTE = Diagnostic(Severity.INFO, "a_code", "a sentence")


@pytest.fixture
def older(path: Path) -> Path:
    """Return a database as one that knew less had written it."""
    with duckdb.connect(str(path)) as connection:
        connection.execute("INSERT INTO cameras BY NAME " + CAMERA)
        connection.execute("ALTER TABLE cameras DROP COLUMN pose_source")
        connection.execute("ALTER TABLE cameras ALTER COLUMN fy_px SET DATA TYPE FLOAT")
        connection.execute("ALTER TABLE cameras ADD COLUMN gone INTEGER")
        connection.execute("DROP TABLE diagnostics CASCADE")
        connection.execute("UPDATE schema_version SET sql_sha256 = 'older'")
    return path


CAMERA = "SELECT 'r' AS recording_id, 'a' AS camera, '/t' AS topic, 9 AS fx_px"
CAMERAS = "SELECT camera, fx_px, pose_source, gone FROM cameras"
BROUGHT = [{"camera": "a", "fx_px": 9.0, "pose_source": None, "gone": None}]


def test_writing_adds_what_is_missing_and_keeps_what_was_stored(older: Path) -> None:
    with Store.open(older) as store:
        assert store.query(CAMERAS).to_pylist() == BROUGHT
        assert str(store.query("SELECT fy_px FROM cameras").schema[0].type) == "double"
        assert store.query("FROM diagnostics").num_rows == 0
        comments = "SELECT comment FROM duckdb_columns() WHERE column_name = 'pose_source'"
        assert all(row["comment"] for row in store.query(comments).to_pylist())


def test_reading_for_ourselves_brings_it_up_to_date_first(older: Path) -> None:
    with Store.open_current(older) as store:
        assert store.query(CAMERAS).to_pylist() == BROUGHT
        with pytest.raises(duckdb.Error, match="read-only"):
            add_diagnostics(store, [], None, "r", "x")


def test_a_question_changes_nothing(older: Path) -> None:
    before = older.read_bytes()
    with Store.open(older, read_only=True) as store:
        assert store.query("SELECT camera FROM cameras").num_rows == 1
    assert older.read_bytes() == before


def test_a_current_database_is_not_opened_for_writing(path: Path) -> None:
    with Store.open(path, read_only=True), Store.open_current(path):
        pass


def test_a_database_with_some_of_the_views_gets_the_others(tmp_path: Path) -> None:
    path = tmp_path / "some.duckdb"
    with Store.hold(path) as store:
        store.prepare(["main.current_run"])
        names = [v.name for v in store.views()]
        assert "estimates" in names
        assert {n for n in names if "." in n or n.startswith("current")} == {"current_run"}
        assert "recording_runs" in names  # which that one needs
    with Store.open(path) as store:
        assert {"accuracy.by_method", "current_estimates"} <= {v.name for v in store.views()}


def test_a_database_without_kept_measurements_gets_room_for_them(path: Path) -> None:
    with duckdb.connect(str(path)) as connection:
        connection.execute("DROP SCHEMA kept CASCADE; DROP TABLE kept_runs; DROP TABLE chosen_runs")
        connection.execute("ALTER TABLE runs DROP COLUMN keep")
        connection.execute("UPDATE schema_version SET sql_sha256 = 'older'")
    with Store.open_current(path) as store:
        assert store.query("FROM all_runs").num_rows == 0
        assert store.query("FROM kept.estimates").num_rows == 0


def test_kept_tables_get_the_columns_that_came_later(path: Path) -> None:
    with duckdb.connect(str(path)) as connection:
        connection.execute("ALTER TABLE kept.cameras DROP COLUMN pose_source")
        connection.execute("ALTER TABLE kept.cameras ALTER COLUMN fy_px SET DATA TYPE FLOAT")
        connection.execute("UPDATE schema_version SET sql_sha256 = 'older'")
    with Store.open(path) as store:
        kept = store.query("SELECT * EXCLUDE (measured_by) FROM kept.cameras").schema
        assert sorted(map(str, kept)) == sorted(map(str, store.query("FROM cameras").schema))
