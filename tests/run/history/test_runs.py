"""Measurements of one recording with different settings stay side by side."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

import stadimeter
from pipeline.cli.main import main
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.core.errors import UsageError
from pipeline.run.recordings import estimate_again, run
from pipeline.store.columns import RECORDING_TABLES
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, write_people

LOW = replace(LEVEL, camera=(replace(LEVEL.camera[0], camera_height_m=1.2),))


@pytest.fixture(scope="module")
def people(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kept") / "people.mcap"
    write_people(path, 4)
    return path


@pytest.fixture(scope="module")
def made(people: Path) -> tuple[Path, Path]:
    """Databases of a recording that was measured once, and again with another height of the camera."""
    once, twice = people.parent / "one.duckdb", people.parent / "two.duckdb"
    run([people], once, LEVEL, label="one")
    shutil.copy(once, twice)
    run([people], twice, LOW, label="two")
    return once, twice


@pytest.fixture
def two(made: tuple[Path, Path], tmp_path: Path) -> Path:
    """A copy of the second, which a test may change."""
    return Path(shutil.copy(made[1], tmp_path / "x.duckdb"))


def answer(db: Path, sql: str) -> list[dict[str, object]]:
    with Store.open(db, read_only=True) as store:
        return store.query(sql).to_pylist()


def state(db: Path) -> dict[str, tuple[bool, bool]]:
    rows = answer(db, "FROM all_runs")
    return {str(r["run_label"]): (bool(r["is_current"]), bool(r["is_kept_aside"])) for r in rows}


def height_m(db: Path) -> float:
    (row,) = answer(db, "SELECT DISTINCT round(camera_height_m, 6) AS height FROM places")
    return float(str(row["height"]))


def test_other_settings_stay_beside_the_newest(two: Path) -> None:
    assert state(two) == {"one": (False, True), "two": (True, False)}
    assert height_m(two) == 1.2
    assert len(answer(two, "FROM recordings")) == 1  # no view mixes the two


def test_runs_of_two_measurements_are_compared(two: Path) -> None:
    sql = "FROM accuracy.compare_runs('one', 'two') WHERE method = 'ground' AND quantity = 'depth'"
    (row,) = answer(two, sql)
    assert row["observation_count"] == 8
    # Depth by the feet grows with the height of the camera (1.2 / 1.5), so nearly 2 m too little.
    assert float(str(row["mae_change_m"])) > 1.5
    (back,) = answer(two, sql.replace("'one', 'two'", "'two', 'one'"))
    assert back["mae_change_m"] == pytest.approx(-float(str(row["mae_change_m"])))
    each = answer(two, "SELECT DISTINCT baseline_label, run_label FROM accuracy.run_comparison")
    assert each == [{"baseline_label": "one", "run_label": "two"}]


def test_a_name_that_no_run_has_is_told(two: Path) -> None:
    with pytest.raises(UsageError, match=r"there is no run three; there are: (one, two|two, one)"):
        answer(two, "FROM accuracy.compare_runs('one', 'three')")


def test_the_same_settings_again_replace_and_do_not_grow(two: Path, people: Path) -> None:
    run([people], two, LOW, label="two")
    assert state(two) == {"one": (False, True), "two": (True, False)}
    run([people], two, LEVEL, label="one")  # comes back from aside, and is there once
    assert state(two) == {"one": (True, False), "two": (False, True)}
    counts = answer(two, "SELECT measured_by, count(*) AS n FROM kept.observations GROUP BY ALL")
    assert [row["n"] for row in counts] == [8]
    assert len(answer(two, "FROM all_runs")) == 2


def test_a_measurement_comes_back_as_it_was(two: Path, made: tuple[Path, Path]) -> None:
    assert main(["runs", "current", "one", "--db", str(two)]) == 0
    assert state(two) == {"one": (True, False), "two": (False, True)}
    assert height_m(two) == 1.5
    for table in RECORDING_TABLES:
        sql = f"FROM {table} ORDER BY ALL"
        assert str(answer(two, sql)) == str(answer(made[0], sql)), table  # NaN is not equal to NaN
    assert answer(two, "FROM estimates")


def test_the_choice_of_an_estimate_holds_until_a_newer_one(two: Path) -> None:
    estimate_again(two, LEVEL, "three")
    assert state(two)["three"] == (True, False)
    stadimeter.make_current(two, "two")
    assert state(two)["two"] == (True, False)
    assert state(two)["three"] == (False, False)
    estimate_again(two, LEVEL, "four")
    assert state(two)["four"] == (True, False)


def test_a_kept_run_is_not_replaced(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    first = run([people], db, LEVEL).run_id
    stadimeter.keep_run(db, first)
    second = run([people], db, LEVEL).run_id
    third = run([people], db, LEVEL).run_id
    assert {r["run_id"] for r in answer(db, "FROM all_runs")} == {first, third}
    assert second not in {r["run_id"] for r in answer(db, "FROM all_runs WHERE keep")}


def test_removing_brings_back_what_is_aside(two: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["runs", "remove", "two", "--db", str(two)]) == 0
    assert state(two) == {"one": (True, False)}
    assert height_m(two) == 1.5
    assert main(["runs", "remove", "one", "--db", str(two)]) == 2
    assert "only measurement" in capsys.readouterr().err
    assert main(["runs", "--db", str(two)]) == 0
    assert "current" in capsys.readouterr().out


def test_removing_what_is_aside_leaves_nothing_of_it(two: Path) -> None:
    stadimeter.remove_run(two, "one")
    assert state(two) == {"two": (True, False)}
    assert [r["label"] for r in answer(two, "FROM runs")] == ["two"]
    for table in RECORDING_TABLES:
        assert not answer(two, f"FROM kept.{table}"), table


def test_merged_parts_stay_side_by_side(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    for name, config in (("one", LEVEL), ("two", LOW)):
        run_shared([people], tmp_path / name, config, label=name)
        assert stadimeter.merge(tmp_path / name, db) == 1
    assert state(db) == {"one": (False, True), "two": (True, False)}
    assert stadimeter.merge(tmp_path / "one", db) == 0  # it is there already


def test_truth_of_files_judges_what_comes_back(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    run([people], db, LEVEL, label="one")
    run([people], db, LOW, label="two")
    truth = tmp_path / "t.csv"
    truth.write_text("frame_index,object_id,depth_m,x_min_px,y_min_px,x_max_px,y_max_px\n")
    with truth.open("a") as file:
        file.writelines(f"{n},late,10,100,115.5,120,179.5\n" for n in range(4))
    stadimeter.truth(truth, db)
    stadimeter.make_current(db, "one")
    assert (
        answer(db, "SELECT count(*) AS n FROM ground_truth WHERE object_id = 'late'")[0]["n"] == 4
    )
    assert len(answer(db, "FROM labelled_frames")) == 4


def test_settings_of_pictures_make_no_other_measurement(people: Path, tmp_path: Path) -> None:
    db = tmp_path / "x.duckdb"
    run([people], db, LEVEL)
    shown = replace(LEVEL, timeline=replace(LEVEL.timeline, split_s=7.0))
    assert json.dumps(shown.timeline.split_s) != json.dumps(Config().timeline.split_s)
    run([people], db, shown)
    assert len(answer(db, "FROM all_runs")) == 1
