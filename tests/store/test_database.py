from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import duckdb
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.core.errors import StoreError, UsageError
from pipeline.core.records import Diagnostic, Severity
from pipeline.core.tables import PASS_ONE
from pipeline.store.columns import RECORDING_TABLES
from pipeline.store.database import Store
from pipeline.store.estimates import read_current
from pipeline.store.recordings import add_diagnostics, list_recordings, replace_recording
from pipeline.store.runs import finish_run
from tests.store.rows import estimate, ingest, recording, start, table, write_parts

TWO = {
    "frames": {"frame_index": [1, 0]},
    "observations": {"frame_index": [1, 0], "track_id": [0, 0], "observation_index": [1, 0]},
    "ground_truth": {"frame_index": [0, 1], "object_id": ["a", "a"], "depth_m": [1.0, 2.0]},
    "cameras": {"camera": ["cam"]},
}


def counts(store: Store) -> dict[str, int]:
    return {
        name: store.query(f"SELECT count(*) AS n FROM {name}")["n"][0].as_py()
        for name in (*RECORDING_TABLES, "runs", "calibrations")
    }


def test_what_pass_one_wrote_comes_back_sorted(store: Store, tmp_path: Path) -> None:
    key = ingest(store, start(store), tmp_path / "p", recording(), **TWO)
    assert store.read("frames", key)["frame_index"].to_pylist() == [0, 1]
    observations = store.read("observations", key)
    assert observations["observation_index"].to_pylist() == [0, 1]
    assert observations.drop_columns("recording_id").schema == PASS_ONE["observations"]
    assert list_recordings(store)["file_name"].to_pylist() == ["a.mcap"]
    assert counts(store)["matches"] == 2


def test_parts_in_several_files_are_one_table(store: Store, tmp_path: Path) -> None:
    folder = write_parts(tmp_path / "p", **TWO)
    (folder / "frames.parquet").unlink()
    for index in (1, 0):
        rows = table(PASS_ONE["frames"], {"frame_index": [index]})
        pq.write_table(rows, folder / f"frames-{index:04d}.parquet")
    with store.transaction():
        key = replace_recording(store, recording(), folder, start_in(store))
    assert store.read("frames", key)["frame_index"].to_pylist() == [0, 1]


def start_in(store: Store) -> str:
    """A run id, inside a transaction."""
    return store.query("SELECT coalesce(max(run_id), 'x') AS r FROM runs")["r"][0].as_py()


def test_a_missing_part_is_an_error_and_nothing_is_kept(store: Store, tmp_path: Path) -> None:
    run_id = start(store)
    folder = write_parts(tmp_path / "p", **TWO)
    (folder / "ground_truth.parquet").unlink()
    with pytest.raises(StoreError, match="left no ground_truth"), store.transaction():
        replace_recording(store, recording(), folder, run_id)
    assert counts(store) == {**dict.fromkeys(counts(store), 0), "runs": 1}


def test_the_same_content_replaces_itself_under_any_name(store: Store, tmp_path: Path) -> None:
    first, second = start(store, "one"), start(store, "two")
    key = ingest(store, first, tmp_path / "p", recording("a.mcap", "same"), **TWO)
    heights = {"height_m": [1.7]}
    estimate(store, key, first, {"observation_index": [0, 1], "depth_m": [1.0, 2.0]}, heights)
    before = counts(store)
    again = ingest(store, second, tmp_path / "p", recording("b.mcap", "same"), **TWO)
    assert again == key
    assert counts(store) == {**before, "estimates": 0, "track_heights": 0}
    assert list_recordings(store)["file_name"].to_pylist() == ["b.mcap"]


def test_other_recordings_are_left_alone(store: Store, tmp_path: Path) -> None:
    run_id = start(store)
    key = ingest(store, run_id, tmp_path / "a", recording("a.mcap"), **TWO)
    ingest(store, run_id, tmp_path / "b", recording("b.mcap"), **TWO)
    ingest(store, run_id, tmp_path / "b", recording("b.mcap"), **TWO)
    assert store.read("observations", key).num_rows == 2
    assert counts(store)["observations"] == 4


def test_two_contents_with_one_key_are_refused(store: Store, tmp_path: Path) -> None:
    run_id, sha = start(store), "0123456789abcdef" + "0" * 48
    ingest(store, run_id, tmp_path / "a", recording(content_sha256=sha), **TWO)
    other = recording("b.mcap", content_sha256=sha[:-1] + "1")
    with pytest.raises(StoreError, match="taken by another recording"):
        ingest(store, run_id, tmp_path / "b", other, **TWO)
    assert counts(store)["recordings"] == 1


def test_observations_without_a_track_are_noise(store: Store, tmp_path: Path) -> None:
    key = ingest(
        store,
        start(store),
        tmp_path / "p",
        recording(),
        observations={"camera": ["a", "a", "b"], "track_id": [1, 2, 1]},
        tracks={"camera": ["a"], "track_id": [1]},
    )
    assert store.read("observations", key)["observation_index"].to_pylist() == [0]


def test_unknown_is_null_and_infinity_a_focus(store: Store, tmp_path: Path) -> None:
    nan, inf = float("nan"), float("inf")
    lens = {"f_number": [nan, 2.0], "focus_distance_m": [inf, nan], "frame_index": [0, 1]}
    run_id = start(store)
    key = ingest(store, run_id, tmp_path / "p", recording(), **{**TWO, "frames": lens})
    frames = store.read("frames", key)
    assert frames["f_number"].to_pylist() == [None, 2.0]
    assert frames["focus_distance_m"].to_pylist() == [inf, None]
    estimate(store, key, run_id, {"depth_m": [nan, inf], "depth_std_m": [0.1, nan]})
    assert store.read("estimates", key)["depth_m"].to_pylist() == [None, None]


def test_estimates_of_a_run_are_replaced_and_runs_kept_apart(store: Store, tmp_path: Path) -> None:
    one, two = start(store, "one"), start(store, "two")
    key = ingest(store, one, tmp_path / "p", recording(), **TWO)
    for run_id, depth_m in ((one, 1.0), (two, 2.0), (two, 3.0)):
        estimate(store, key, run_id, {"depth_m": [depth_m]}, {"height_m": [depth_m]})
    assert sorted(store.read("estimates", key)["depth_m"].to_pylist()) == [1.0, 3.0]
    assert read_current(store, "estimates", key)["depth_m"].to_pylist() == [3.0]
    assert read_current(store, "track_heights", key)["height_m"].to_pylist() == [3.0]


def test_a_calibration_is_entered_once_a_run(store: Store, tmp_path: Path) -> None:
    one, two = start(store), start(store)
    key = ingest(store, one, tmp_path / "p", recording(), **TWO)
    fit = {
        "calibration_id": ["c", "c"],
        "object_class": ["staff"] * 2,
        "dimension": ["width"] * 2,
        "method": ["inverse"] * 2,
        "parameter": ["b0_m", "b1_m_mm"],
        "value": [0.1, 2.0],
    }
    for run_id in (one, one, two):
        estimate(store, key, run_id, {}, calibrations=fit)
    assert counts(store)["calibrations"] == 4


def ingest_and_fail(store: Store, run_id: str, folder: Path) -> None:
    with store.transaction():
        replace_recording(store, recording(), folder, run_id)
        raise ZeroDivisionError


def ingest_and_carry_on(store: Store, run_id: str, good: Path, bad: Path) -> None:
    with store.transaction():
        replace_recording(store, recording(), good, run_id)
        with suppress(duckdb.Error):
            replace_recording(store, recording("b.mcap"), bad, run_id)


def test_an_error_rolls_everything_back(store: Store, tmp_path: Path) -> None:
    run_id = start(store)
    with pytest.raises(ZeroDivisionError):
        ingest_and_fail(store, run_id, write_parts(tmp_path / "p", **TWO))
    assert counts(store)["recordings"] == 0
    ingest(store, run_id, tmp_path / "p", recording(), **TWO)  # and the store goes on working
    assert counts(store)["observations"] == 2


def test_a_swallowed_error_is_not_committed_as_success(store: Store, tmp_path: Path) -> None:
    """DuckDB turns COMMIT into a ROLLBACK without a word after some failures."""
    good = write_parts(tmp_path / "good", **TWO)
    bad = write_parts(tmp_path / "bad", **{**TWO, "frames": {"camera": [None]}})
    with pytest.raises(StoreError, match="nothing of this step was stored"):
        ingest_and_carry_on(store, start(store), good, bad)
    assert counts(store)["recordings"] == 0


def test_transactions_do_not_nest(store: Store) -> None:
    with pytest.raises(RuntimeError), store.transaction(), store.transaction():
        pass


def test_hostile_names_are_data(store: Store, tmp_path: Path) -> None:
    camera = "'; DROP TABLE runs; --"
    run_id = start(store, label=camera)
    key = ingest(
        store,
        run_id,
        tmp_path / camera.replace("/", ""),
        recording('"; DELETE FROM runs; --.mcap'),
        cameras={"camera": [camera]},
        frames={"camera": [camera]},
        observations={"camera": [camera], "object_id": [camera], "class_name": [camera]},
        ground_truth={"camera": [camera], "object_id": [camera], "depth_m": [2.0]},
    )
    estimate(store, key, run_id, {"depth_m": [2.5], "method": [camera]})
    with store.transaction():
        note = Diagnostic(Severity.ERROR, camera, camera, camera=camera, topic=camera)
        add_diagnostics(store, [note], None, run_id, camera)
    assert store.query("SELECT camera FROM accuracy.by_camera")["camera"].to_pylist() == [camera]
    with pytest.raises(UsageError, match="there is no run '; DROP and no run x; there are: "):
        store.query("FROM accuracy.compare_runs($$'; DROP$$, $$x$$)")
    assert counts(store)["runs"] == 1
    for view in store.views():
        if "(" not in view.name:
            store.query(f"FROM {view.name}")


def test_diagnostics_of_a_file_that_is_no_recording(store: Store) -> None:
    run_id = start(store)
    with store.transaction():
        add_diagnostics(
            store, [Diagnostic(Severity.ERROR, "unreadable_file", "empty")], None, run_id, "x.mcap"
        )
    row = store.query("FROM diagnostics").to_pylist()[0]
    assert (row["recording_id"], row["file_name"], row["count"]) == (None, "x.mcap", 1)


def test_runs_have_a_beginning_and_an_end(store: Store) -> None:
    run_id = start(store, "night")
    assert store.query("SELECT finished_at FROM runs")["finished_at"].null_count == 1
    finish_run(store, run_id)
    row = store.query("SELECT *, finished_at >= started_at AS ordered FROM runs").to_pylist()[0]
    assert (row["run_id"], row["label"], row["ordered"]) == (run_id, "night", True)
    assert len(run_id) == 12


@pytest.mark.parametrize("name", ["frames; DROP TABLE runs", "runs", "accuracy.errors"])
def test_only_tables_of_recordings_are_read(store: Store, name: str) -> None:
    with pytest.raises(ValueError, match="no table"):
        store.read(name, "x")


@pytest.mark.parametrize(
    "sql",
    [
        "DROP TABLE runs",
        "DELETE FROM runs",
        "CREATE TABLE t AS SELECT 1",
        "SELECT 1; DROP TABLE runs",
        "",
        "COPY (SELECT 1) TO '{folder}/out.csv'",
        "COPY (SELECT 1) TO '{folder}/out.parquet' (FORMAT parquet)",
        "EXPORT DATABASE '{folder}/out'",
        "ATTACH '{folder}/out.duckdb' AS other",
        "FROM read_csv('/etc/passwd')",
        "FROM read_text('/etc/hostname')",
        "SET enable_external_access = true",
        "SET memory_limit = '1GB'",
        "INSTALL httpfs",
        "LOAD httpfs",
        "SELEC 1",
    ],
)
@pytest.mark.parametrize("read_only", [True, False])
def test_a_question_changes_nothing(path: Path, tmp_path: Path, sql: str, read_only: bool) -> None:
    with Store.open(path) as store:
        start(store)
    with Store.open(path, read_only=read_only) as store:
        with pytest.raises(UsageError):
            store.query(sql.format(folder=tmp_path))
        assert counts(store)["runs"] == 1
    assert {p.name for p in tmp_path.iterdir()} <= {"a.duckdb", "a.duckdb.wal"}


def test_a_question_is_answered_as_arrow(store: Store) -> None:
    answer = store.query("SELECT 42 AS n, [1.5] AS l;")
    assert isinstance(answer, pa.Table)
    assert answer.to_pylist() == [{"n": 42, "l": [1.5]}]


def test_python_variables_are_no_tables(store: Store) -> None:
    secret = pa.table({"a": [1]})
    assert secret.num_rows == 1
    with pytest.raises(UsageError):
        store.query("FROM secret")
