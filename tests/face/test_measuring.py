"""The functions of the package on small recordings: results, errors and warnings."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import duckdb
import pandas as pd
import pyarrow as pa
import pytest

import stadimeter
from tests.run.test_recordings import write_people

LEVEL = stadimeter.Config(
    camera=(stadimeter.CameraConfig("cam", camera_height_m=1.5, tilt_deg=0.0),)
)


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("face") / "people.mcap"
    write_people(path)
    return path


@pytest.fixture(scope="module")
def database(people: Path) -> Path:
    path = people.with_name("people.duckdb")
    told: list[stadimeter.Progress] = []
    result = stadimeter.measure(people, str(path), camera=LEVEL, progress=told.append)
    assert [outcome.path for outcome in result.stored] == [people]
    assert told[-1].stage == "done"
    return path


def test_answers_are_the_same_as_arrow_pandas_and_duckdb(database: Path) -> None:
    with stadimeter.open(database) as results:
        estimates = results.view("estimates")
        assert "recordings" in results.catalog().arrow()["name"].to_pylist()
        assert len(results.recordings()) == 1
    table = estimates.arrow()  # the database is closed: the rows stay
    assert isinstance(table, pa.Table)
    assert len(estimates) == table.num_rows > 0
    frame = estimates.pandas()
    assert isinstance(frame, pd.DataFrame)
    total_m = sum(v for v in table["depth_m"].to_pylist() if v is not None)
    assert math.isclose(frame["depth_m"].sum(), total_m)
    for relation in (estimates.duckdb(), estimates.duckdb(duckdb.connect())):
        ((count, from_duckdb_m),) = relation.aggregate("count(*), sum(depth_m)").fetchall()
        assert count == len(estimates)
        assert math.isclose(from_duckdb_m, total_m)
    assert pa.table(estimates).equals(table)  # over the Arrow C stream
    assert estimates.rows() == table.to_pylist()


def test_unknown_is_missing_and_not_zero(database: Path) -> None:
    with stadimeter.open(database) as results:
        answer = results.query("SELECT NULL::INTEGER AS a, 2 AS b UNION ALL SELECT 1, 3 ORDER BY b")
    frame = answer.pandas()
    assert frame["a"].isna().tolist() == [True, False]
    assert frame["a"].dropna().tolist() == [1]
    assert answer.rows()[0]["a"] is None


def test_questions_change_nothing_and_errors_say_what_is_wrong(database: Path) -> None:
    with stadimeter.open(database) as results:
        with pytest.raises(stadimeter.UsageError, match="nothing"):
            results.view("nothing")
        with pytest.raises(stadimeter.UsageError, match="read"):
            results.query("DELETE FROM runs")
        with pytest.raises(stadimeter.UsageError, match="DuckDB"):
            results.query("SELEC")
        with pytest.raises(stadimeter.UsageError, match="no view or table"):
            results.view("runs; DROP TABLE runs")
        assert len(results.query("FROM runs WHERE command = $c", {"c": "run"})) == 1
    with pytest.raises(stadimeter.StoreError, match="no such database"):
        stadimeter.open(database.with_name("none.duckdb"))


def test_a_closed_database_can_be_written_to(database: Path) -> None:
    stadimeter.open(database).close()
    done = stadimeter.estimate(database, camera=LEVEL, label="again")
    with stadimeter.open(database) as results:
        (row,) = results.query("FROM runs WHERE run_id = ?", [done.run_id]).rows()
    assert (row["command"], row["label"], done.recording_count) == ("estimate", "again", 1)


def test_a_failure_is_raised_after_the_others_are_stored(people: Path, tmp_path: Path) -> None:
    absent, empty = tmp_path / "absent.mcap", tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    db = tmp_path / "x.duckdb"
    with pytest.raises(stadimeter.StadimeterError, match=r"absent\.mcap"):
        stadimeter.measure([absent, empty, people], db)
    with stadimeter.open(db) as results:
        assert [row["file_name"] for row in results.recordings().rows()] == [people.name]
    result = stadimeter.measure([empty, people], db, strict=False)
    assert [o.path for o in result.failed] == [empty]
    assert [o.path for o in result.stored] == [people]


def test_damage_is_warned_of(tmp_path: Path) -> None:
    broken = tmp_path / "broken.mcap"
    write_people(broken, broken=4)
    with pytest.warns(stadimeter.DamageWarning, match=r"broken\.mcap"):
        result = stadimeter.measure(broken, tmp_path / "x.duckdb")
    assert result.damaged


def test_a_folder_of_parts_is_asked_and_merged(people: Path, tmp_path: Path) -> None:
    made = stadimeter.measure_parts([people], tmp_path / "parts", camera=LEVEL)
    assert [one.path for one in made.made] == [people]
    again = stadimeter.measure_parts(people, tmp_path / "parts", camera=LEVEL)
    assert not again.made
    with stadimeter.open(tmp_path / "parts") as results:
        count = len(results.view("estimates"))
    assert stadimeter.merge(tmp_path / "parts", tmp_path / "all.duckdb") == 1
    with stadimeter.open(tmp_path / "all.duckdb") as results:
        assert len(results.view("estimates")) == count > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"workers": 0}, "at least 1"),
        ({"model": "x.onnx", "detector": "roi"}, "goes with the detectors motion and onnx"),
        ({"preview_px": 3}, "16 pixels"),
        ({"split_minutes": 0}, "above 0 minutes"),
        ({"camera": "absent.toml"}, "absent.toml"),
        (
            {"camera": replace(LEVEL, camera=(stadimeter.CameraConfig("cam", tilt_deg=100.0),))},
            "tilt_deg",
        ),
    ],
)
def test_impossible_arguments_are_refused_before_the_work(
    people: Path, tmp_path: Path, arguments: dict[str, object], words: str
) -> None:
    with pytest.raises(stadimeter.UsageError, match=words):
        stadimeter.measure(people, tmp_path / "x.duckdb", **arguments)
    assert not (tmp_path / "x.duckdb").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"folds": 1}, "at least 2"),
        ({"by": "guessing"}, "truth, walkers or blur"),
        ({"known_heights_m": {1: 1.8}}, "by walkers"),
        ({"methods": ["fused"]}, "'fused'"),
    ],
)
def test_impossible_calibrations_are_refused(
    database: Path, tmp_path: Path, arguments: dict[str, object], words: str
) -> None:
    with pytest.raises(stadimeter.UsageError, match=words):
        stadimeter.calibrate(database, tmp_path / "c.toml", **arguments)
    assert not (tmp_path / "c.toml").exists()


def test_few_walkers_determine_no_pose(database: Path, tmp_path: Path) -> None:
    ((camera, found),) = stadimeter.calibrate(database, tmp_path / "w.toml", by="walkers")
    assert camera == "cam"
    assert isinstance(found, stadimeter.CalibrationUndetermined)


def test_inspecting_and_exporting(people: Path, database: Path, tmp_path: Path) -> None:
    found = stadimeter.inspect(people)
    assert [camera.frame_count for camera in found.cameras] == [12]
    done = stadimeter.export(people, database, tmp_path / "out.mcap")
    assert done.frames == 12
    assert stadimeter.inspect(tmp_path / "out.mcap").cameras[0].frame_count == 12
    with pytest.raises(stadimeter.UsageError, match="no such file"):
        stadimeter.inspect(tmp_path / "absent.mcap")


def test_a_review_is_written(people: Path, database: Path, tmp_path: Path) -> None:
    done = stadimeter.review(people, database, output=tmp_path / "r.rrd", preview_px=64)
    assert done.path == tmp_path / "r.rrd"
    assert done.path.stat().st_size > 0
    assert not done.hindrance
