"""The same evidence counts once, and what was done about it is told."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader

from pipeline.cluster.manifest import read_manifests
from pipeline.cluster.results_folder import merge
from pipeline.cluster.shared_run import run_shared
from pipeline.run.recordings import run
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, write_people


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "people.mcap"
    write_people(path, frames=12)
    return path


def stored(database: Path) -> tuple[list[str], int, set[str]]:
    with Store.open(database, read_only=True) as store:
        names = store.query("SELECT file_name FROM recordings ORDER BY ALL")["file_name"]
        frames = store.query("SELECT * FROM frames").num_rows
        codes = store.query("SELECT code FROM diagnostics")["code"].to_pylist()
    return names.to_pylist(), frames, set(codes)


def begun(whole: Path, path: Path) -> Path:
    """Write a recording as it was while it grew: cut in its last third."""
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    return path


def test_a_recording_that_grew_replaces_what_was_read_of_it(whole: Path, tmp_path: Path) -> None:
    path, database = tmp_path / "live.mcap", tmp_path / "x.duckdb"
    begun(whole, path)
    run([path], database, LEVEL)
    before = stored(database)
    assert 0 < before[1] < 12
    shutil.copy(whole, path)
    run([path], database, LEVEL)
    names, frames, codes = stored(database)
    assert (names, frames) == (["live.mcap"], 12)
    assert "replaced_beginning" in codes


def test_the_beginning_of_a_stored_recording_is_refused(whole: Path, tmp_path: Path) -> None:
    database = tmp_path / "x.duckdb"
    result = run([whole, begun(whole, tmp_path / "live.mcap")], database, LEVEL)
    assert [o.path for o in result.stored] == [whole]
    assert "only the beginning of" in str(result.failed[0].error)
    assert stored(database)[:2] == (["people.mcap"], 12)


def test_the_same_bytes_under_another_path_count_once(whole: Path, tmp_path: Path) -> None:
    other, database = tmp_path / "copy.mcap", tmp_path / "x.duckdb"
    shutil.copy(whole, other)
    run([whole], database, LEVEL)
    run([whole], database, LEVEL)
    assert "same_content" not in stored(database)[2]
    run([other], database, LEVEL)
    names, frames, codes = stored(database)
    assert (names, frames) == (["copy.mcap"], 12)
    assert "same_content" in codes


def split_files(folder: Path, firsts: tuple[int, ...] = (0, 4), frames: int = 6) -> list[Path]:
    """Write files of one camera that share frames, each with a person in truth and detections."""
    paths = [folder / f"{number}.mcap" for number in range(len(firsts))]
    for path, first in zip(paths, firsts, strict=True):
        write_people(path, frames, first=first)
    return paths


def counted(database: Path) -> tuple[int, int, int, int]:
    """Return the rows of estimates, errors and people as counted, and frames that are repeated."""
    names = ("current_estimates", "accuracy.errors", "people", "repeated_frames")
    with Store.open(database, read_only=True) as store:
        found = [store.query(f"FROM {name}").num_rows for name in names]
    return found[0], found[1], found[2], found[3]


def test_frames_of_files_that_overlap_count_once(tmp_path: Path) -> None:
    """Counts over split files are those of one file of all frames, in any order."""
    whole, database = tmp_path / "whole", tmp_path / "x.duckdb"
    whole.mkdir()
    run(split_files(whole, (0,), 10), whole / "x.duckdb", LEVEL)
    expected = counted(whole / "x.duckdb")
    assert expected[0] > 0 < expected[1]
    paths = split_files(tmp_path)
    run([paths[1]], database, LEVEL)
    run([paths[0]], database, LEVEL)
    found = counted(database)
    assert found[:2] == expected[:2]
    assert found[3] == 2
    with Store.open(database, read_only=True) as store:
        rows = store.query(
            "SELECT file_name, count FROM diagnostics WHERE code = 'overlapping_recordings'"
        )
        assert store.query("FROM recording_estimates").num_rows > found[0]
    assert rows.to_pylist() == [{"file_name": "1.mcap", "count": 2}]


def test_a_file_that_lies_within_another_counts_no_further_people(tmp_path: Path) -> None:
    paths = split_files(tmp_path, (2, 0))
    write_people(paths[1], 12)
    run([paths[1]], tmp_path / "one.duckdb", LEVEL)
    run(paths, tmp_path / "x.duckdb", LEVEL, workers=2)
    assert counted(tmp_path / "x.duckdb")[:3] == counted(tmp_path / "one.duckdb")[:3]


def test_split_files_in_a_folder_of_parts_and_merged_count_once(tmp_path: Path) -> None:
    paths = split_files(tmp_path)
    run(paths, tmp_path / "x.duckdb", LEVEL)
    result = run_shared(paths, tmp_path / "parts", LEVEL)
    assert [(name, note.count) for name, note in result.notes] == [("1.mcap", 2)]
    assert merge(tmp_path / "parts", tmp_path / "merged.duckdb") == 2
    assert counted(tmp_path / "merged.duckdb") == counted(tmp_path / "x.duckdb")
    assert "overlapping_recordings" in stored(tmp_path / "merged.duckdb")[2]


def test_a_recording_that_grew_counts_once_in_a_folder_of_parts(
    whole: Path, tmp_path: Path
) -> None:
    path, parts = tmp_path / "live.mcap", tmp_path / "parts"
    begun(whole, path)
    before = run_shared([path], parts, LEVEL)
    merge(parts, tmp_path / "x.duckdb")
    shutil.copy(whole, path)
    again = run_shared([path], parts, LEVEL)
    assert [note.code for _, note in again.notes] == ["replaced_beginning"]
    assert before.made[0].manifest is not None
    assert [m.frame_count for m in read_manifests(parts)] == [12]
    late = run_shared([begun(whole, tmp_path / "late.mcap")], parts, LEVEL)
    assert "only the beginning of" in str(late.failed[0].error)
    assert [m.frame_count for m in read_manifests(parts)] == [12]
    shutil.copy(whole, tmp_path / "copy.mcap")
    copied = run_shared([tmp_path / "copy.mcap"], parts, LEVEL)
    assert [note.code for _, note in copied.notes] == ["same_content"]
    assert merge(parts, tmp_path / "x.duckdb") == 1  # in place of the beginning
    assert stored(tmp_path / "x.duckdb")[:2] == (["copy.mcap"], 12)


def test_a_shorter_file_in_the_place_of_a_longer_one_is_stored(tmp_path: Path) -> None:
    path, database = tmp_path / "a.mcap", tmp_path / "x.duckdb"
    write_people(path, 12)
    run([path], database, LEVEL)
    write_people(path, 5)
    assert run([path], database, LEVEL).failed == []
