"""The same evidence counts once, and what was done about it is told."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader

from pipeline.mcap_file.writer import RecordingWriter, image_message
from pipeline.run.recordings import run
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, START_NS, jpeg, write_people


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


def test_files_that_overlap_are_told(tmp_path: Path) -> None:
    paths = [tmp_path / "0.mcap", tmp_path / "1.mcap"]
    for path, first in zip(paths, (0, 4), strict=True):
        with RecordingWriter(path) as writer:
            for index in range(first, first + 6):
                time_ns = START_NS + index * 100_000_000
                data = jpeg(40 + 9 * index)
                writer.write("/i", image_message(data, "jpeg", time_ns, "cam"), time_ns)
    run(paths, tmp_path / "x.duckdb", LEVEL)
    with Store.open(tmp_path / "x.duckdb", read_only=True) as store:
        rows = store.query(
            "SELECT file_name, count FROM diagnostics WHERE code = 'overlapping_recordings'"
        )
    assert rows.to_pylist() == [{"file_name": "1.mcap", "count": 2}]
