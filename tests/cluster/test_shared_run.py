"""A folder of finished recordings: the same answers as a database, and nothing done twice."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.cli.query import answer
from pipeline.cluster.manifest import read_manifests
from pipeline.cluster.results_folder import merge, open_shared
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError, StoreError
from pipeline.run.recordings import run
from pipeline.store.columns import RECORDING_TABLES
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, write_people
from tests.support.tables import assert_same, everything


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings and a file that is none, in a folder, and in a database beside it."""
    folder = tmp_path_factory.mktemp("shared")
    write_people(folder / "a.mcap")
    write_people(folder / "b.mcap", frames=9, broken=4)
    (folder / "c.mcap").write_bytes(b"no recording")
    paths = [folder / name for name in ("a.mcap", "b.mcap", "c.mcap")]
    result = run_shared(paths, folder / "parts", LEVEL, label="night")
    assert [f.path.name for f in result.made] == ["a.mcap", "b.mcap"]
    assert [f.path.name for f in result.damaged] == ["b.mcap"]
    assert "not an MCAP file" in str(result.failed[0].error)
    assert [(name, note.code) for name, note in result.notes] == [
        ("b.mcap", "overlapping_recordings")
    ]
    run(paths, folder / "one.duckdb", LEVEL, label="night")
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy that a test may change, beside the recordings that it was made of."""
    shutil.copytree(made / "parts", tmp_path / "parts")
    return tmp_path / "parts"


def test_parts_answer_as_a_database_does(made: Path) -> None:
    with Store.open(made / "one.duckdb", read_only=True) as store:
        expected = everything(store)
    with open_shared(made / "parts") as store:
        found = everything(store)
        # Parts are made alone: that both recordings have the same pictures is told, and has no row.
        said = expected["diagnostics"]
        twice = said["code"] == "overlapping_recordings"
        expected["diagnostics"] = said[~twice].reset_index(drop=True)
        described = {v.name: (v.comment, v.columns, v.column_comments) for v in store.views()}
    assert_same(found, expected)
    assert len(expected["estimates"]) > 0
    assert sum(twice) == 1
    assert 0 < len(found["current_estimates"]) < len(found["recording_estimates"])
    with Store.open(made / "one.duckdb", read_only=True) as store:
        same = {v.name: (v.comment, v.columns, v.column_comments) for v in store.views()}
    assert described == same


def test_merged_parts_are_the_database(made: Path, tmp_path: Path) -> None:
    target = tmp_path / "merged.duckdb"
    assert merge(made / "parts", target) == 3
    assert merge(made / "parts", target) == 0
    with Store.open(made / "one.duckdb", read_only=True) as store:
        expected = everything(store)
    with Store.open(target, read_only=True) as store:
        assert_same(everything(store), expected)


def test_a_second_start_does_what_is_missing(made: Path, folder: Path) -> None:
    paths = [made / "a.mcap", made / "b.mcap"]
    again = run_shared(paths, folder, LEVEL)
    assert [f.path for f in again.there] == paths
    assert again.made == []
    lost = next(m for m in read_manifests(folder) if m.failure is None)
    (folder / lost.parts["estimates"].path).unlink()
    again = run_shared(paths, folder, LEVEL)
    assert (len(again.there), len(again.made)) == (1, 1)
    changed = replace(LEVEL, estimate=replace(LEVEL.estimate, extrapolate=True))
    assert len(run_shared(paths, folder, changed).made) == 2
    for manifest in read_manifests(folder):  # and no file of the older results is left
        if manifest.failure is None:
            assert len(list((folder / "parts" / manifest.key).iterdir())) == 1


def test_a_file_that_changed_is_done_again(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_people(path)
    run_shared([path], tmp_path / "parts", LEVEL)
    write_people(path, frames=5)
    again = run_shared([path], tmp_path / "parts", LEVEL)
    assert again.made[0].manifest is not None
    assert again.made[0].manifest.frame_count == 5


def test_half_written_results_are_not_seen(made: Path, folder: Path) -> None:
    key = next(m.key for m in read_manifests(folder) if m.failure is None)
    torn = folder / "parts" / key / "torn"
    torn.mkdir()
    (torn / "estimates.parquet").write_bytes(b"PAR1 half")
    with open_shared(folder) as store, open_shared(made / "parts") as whole:
        count = "SELECT count(*) AS n FROM estimates"
        assert store.query(count).to_pylist() == whole.query(count).to_pylist()


def test_a_part_that_was_changed_is_not_merged(folder: Path, tmp_path: Path) -> None:
    path = next((folder / "parts").glob("*/*/estimates.parquet"))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(StoreError, match="not what was written"):
        merge(folder, tmp_path / "x.duckdb")


@pytest.mark.parametrize(
    "sql",
    [
        "COPY (SELECT 1) TO '{parts}/parts/x.csv'",
        "EXPORT DATABASE '{parts}/parts/x'",
        "ATTACH '{parts}/parts/x.duckdb' AS x",
        "FROM read_text('/etc/hostname')",
        "FROM read_json('{parts}/manifests/*.json')",
        "SET enable_external_access = true",
        "DROP VIEW estimates",
    ],
)
def test_a_question_reaches_nothing_else(folder: Path, sql: str) -> None:
    before = sorted(folder.rglob("*"))
    with pytest.raises(StadimeterError):
        answer(Path("none"), sql.format(parts=folder), None, folder)
    assert sorted(folder.rglob("*")) == before


def test_an_empty_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(StoreError, match="no recording is finished"):
        open_shared(tmp_path)


def test_no_recordings_are_no_work(tmp_path: Path) -> None:
    assert run_shared([], tmp_path / "parts", Config()).stored == []


def test_tables_are_all_exported(made: Path) -> None:
    for manifest in read_manifests(made / "parts"):
        assert set(manifest.parts) == {*RECORDING_TABLES, "runs", "calibrations"}
