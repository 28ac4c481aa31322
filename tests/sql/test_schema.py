"""SQL files agree with core/tables.py, explain every column, and load in any order of names."""

from __future__ import annotations

import re
from importlib.resources import files

import pyarrow as pa
import pytest

from pipeline.core.tables import PASS_ONE, PASS_TWO
from pipeline.store.database import Store
from pipeline.store.schema import view_scripts

ADDED = {"recording_id", "run_id", "file_name"}  # by the store
TYPES = {
    pa.string(): "VARCHAR",
    pa.int32(): "INTEGER",
    pa.int64(): "BIGINT",
    pa.float64(): "DOUBLE",
    pa.bool_(): "BOOLEAN",
    pa.list_(pa.float64()): "DOUBLE[]",
    pa.float32(): "FLOAT",
    pa.list_(pa.float32(), 6): "FLOAT[6]",
}


@pytest.mark.parametrize("name", [*PASS_ONE, *PASS_TWO])
def test_tables_are_the_records(store: Store, name: str) -> None:
    rows = store.query(
        "SELECT column_name, data_type FROM duckdb_columns() "
        f"WHERE table_name = '{name}' AND schema_name = 'main' ORDER BY column_index"
    ).to_pylist()
    found = {r["column_name"]: r["data_type"] for r in rows if r["column_name"] not in ADDED}
    assert found == {c.name: TYPES[c.type] for c in (PASS_ONE | PASS_TWO)[name]}
    added = {r["column_name"] for r in rows} & ADDED
    assert added <= ADDED
    assert added


def test_everything_is_explained(store: Store) -> None:
    views = store.views()
    assert len(views) > 40
    assert [v.name for v in views if not (v.comment or "").strip()] == []
    bare = [
        f"{v.name}.{column}"
        for v in views
        if "(" not in v.name
        for column, comment in zip(v.columns, v.column_comments, strict=True)
        if not (comment or "").strip()
    ]
    assert bare == []


def test_views_and_macros_ask_a_question(store: Store) -> None:
    tables = set(store.query("SELECT table_name FROM duckdb_tables()")["table_name"].to_pylist())
    silent = [v.name for v in store.views() if v.name not in tables and "?" not in v.comment]
    assert silent == []


@pytest.mark.parametrize("name", [name for name, _ in view_scripts()])
def test_a_file_holds_the_view_of_its_name(name: str) -> None:
    script = (files("schemas") / "sql" / "views" / f"{name}.sql").read_text()
    assert script.startswith("-- ")
    made = re.findall(r"^CREATE OR REPLACE (?:VIEW|MACRO) ([\w.]+)", script, re.MULTILINE)
    assert made == [name]
    kind = "VIEW" if "CREATE OR REPLACE VIEW" in script else "MACRO TABLE"
    assert f"COMMENT ON {kind} {name} IS '" in script
    assert all(len(line) <= 100 for line in script.splitlines() if not _is_text(line))


def _is_text(line: str) -> bool:
    return line.startswith("COMMENT ON") or line.lstrip().startswith("('")


def test_every_word_of_the_glossary_is_used(store: Store) -> None:
    unused = store.query(
        "SELECT column_name FROM glossary "
        "WHERE column_name NOT IN (SELECT column_name FROM duckdb_columns() WHERE NOT internal)"
    )
    assert unused["column_name"].to_pylist() == []


def test_without_truth_there_is_nothing_to_say(store: Store) -> None:
    for view in store.views():
        if view.name.startswith("accuracy.") and "(" not in view.name:
            assert store.query(f"FROM {view.name}").num_rows == 0, view.name
    for name in ("depth_by_aperture", "k_by_aperture", "real_height", "inverse_model_summary"):
        assert store.query(f"FROM paper.{name}").num_rows == 0


def test_views_explain_a_column_as_the_table_it_is_from(store: Store) -> None:
    """Several tables have `method`; that of estimates is not one of calibrations'."""
    by_name = {v.name: dict(zip(v.columns, v.column_comments, strict=False)) for v in store.views()}
    shown, estimates = by_name["current_estimates"], by_name["estimates"]
    for column in ("method", "calibration_id", "depth_m", "height_m"):
        assert shown[column] == estimates[column], column
    assert shown["frame_index"] == by_name["frames"]["frame_index"]
