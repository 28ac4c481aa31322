"""The promises of docs/promises.md that are of whole runs, and that each has a test that is there."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import stadimeter
from pipeline.cli.main import main
from pipeline.cluster.shared_run import run_shared
from pipeline.core.config import Config
from pipeline.run.recordings import run
from pipeline.run.verify import verify_recordings
from pipeline.store.database import Store
from pipeline.store.fingerprint import tables_sha256
from tests.cli.test_commands import ROOT
from tests.run.test_recordings import LEVEL, write_people


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("promises")
    paths = [folder / f"{n}.mcap" for n in range(2)]
    for n, path in enumerate(paths):
        write_people(path, frames=12 + n)
    return paths


def hashes(database: Path) -> dict[str, str]:
    with Store.open(database, read_only=True) as store:
        rows = store.query("SELECT file_name, tables_sha256 FROM recordings").to_pylist()
    return {row["file_name"]: row["tables_sha256"] for row in rows}


def test_any_number_of_processes_gives_identical_tables(
    recordings: list[Path], tmp_path: Path
) -> None:
    found = []
    for workers in (1, 2):
        database = tmp_path / f"{workers}.duckdb"
        result = run(recordings, database, LEVEL, workers=workers)
        found.append(hashes(database))
        assert {o.path.name: o.tables_sha256 for o in result.outcomes} == found[-1]
    run_shared(recordings, tmp_path / "parts", LEVEL)
    stadimeter.merge(tmp_path / "parts", tmp_path / "merged.duckdb")
    found.append(hashes(tmp_path / "merged.duckdb"))
    assert found[0] == found[1] == found[2]
    assert len(set(found[0].values())) == 2
    other = run(recordings, tmp_path / "other.duckdb", Config())
    assert {o.tables_sha256 for o in other.outcomes}.isdisjoint(found[0].values())


def test_the_hash_knows_every_row(recordings: list[Path], tmp_path: Path) -> None:
    database = tmp_path / "x.duckdb"
    result = run(recordings[:1], database, LEVEL)
    row = result.outcomes[0].recording
    assert row is not None
    with Store.open(database) as store:
        before = tables_sha256(store, row.recording_id, result.run_id)
        assert before == result.outcomes[0].tables_sha256
        for change in (
            "UPDATE estimates SET depth_m = depth_m + 1e-9 WHERE observation_index = 0",
            "DELETE FROM observations WHERE observation_index = 1",
            "UPDATE frames SET decoded = NOT decoded WHERE frame_index = 3",
        ):
            with store.transaction():
                store.connection.execute(change)
            after = tables_sha256(store, row.recording_id, result.run_id)
            assert after != before, change
            before = after


def test_verify_finds_a_changed_file_and_changed_rows(
    recordings: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [Path(shutil.copy(path, tmp_path / path.name)) for path in recordings]
    database = tmp_path / "x.duckdb"
    run(paths, database, LEVEL)
    found = verify_recordings(database, 5, 0)
    assert [(v.problem, v.frames_compared, v.all_rows_equal) for v in found] == [("", 5, True)] * 2
    assert main(["verify", "--db", str(database), "--frames", "0"]) == 0
    with Store.open(database) as store, store.transaction():
        store.connection.execute(
            "UPDATE estimates SET depth_m = depth_m * 1.001 WHERE recording_id = "
            "(SELECT recording_id FROM recordings WHERE file_name = '0.mcap')"
        )
    data = bytearray(paths[1].read_bytes())
    data[len(data) // 2] ^= 1
    paths[1].write_bytes(data)
    capsys.readouterr()
    assert main(["verify", "--db", str(database), "--frames", "12"]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "0.mcap: measured again, rows of 12 frames differ in: estimates" in said
    assert "1.mcap: the file has changed since it was measured" in said
    paths[1].unlink()
    assert "is not there" in verify_recordings(database, 0, 0)[1].problem


def test_every_promise_names_a_test_that_is_there() -> None:
    text = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text)
    rows = [line for line in text.split("\n## ")[0].splitlines() if line.startswith("| ")][1:]
    assert len(named) >= len(rows) > 5
    for file, test in named:
        assert re.search(rf"^def {test}\(", (ROOT / file).read_text(encoding="utf-8"), re.M), test
