"""Every so manieth picture is measured: the others are not decoded, and their boxes go nowhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import stadimeter
from pipeline.core.config import Config
from pipeline.core.errors import UsageError
from pipeline.images.decode import decode
from pipeline.run import camera_stage
from pipeline.run.recordings import run
from pipeline.run.windows.split import windows_by_index
from pipeline.store.database import Store
from tests.run.test_recordings import LEVEL, write_people
from tests.run.windows.test_split import write_crossings


def every(count: int) -> Config:
    return replace(LEVEL, ingest=replace(LEVEL.ingest, every=count))


def test_one_of_five_pictures_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "people.mcap"
    write_people(path, 23, broken=7)  # one that is left out: nobody looks at it
    decoded: list[int] = []

    def counted(data, **named):  # type: ignore[no-untyped-def]
        decoded.append(len(data))
        return decode(data, **named)

    monkeypatch.setattr(camera_stage, "decode", counted)
    found = {}
    for count in (1, 5):
        decoded.clear()
        database = tmp_path / f"{count}.duckdb"
        result = run([path], database, every(count))
        assert bool(result.damaged) is (count == 1)
        assert len(decoded) == {1: 23, 5: 5}[count]
        with Store.open(database, read_only=True) as store:
            found[count] = {
                table: store.query(f"FROM {table}").to_pylist()
                for table in ("frames", "observations", "ground_truth", "diagnostics")
            }
    frames = found[5]["frames"]
    assert [f["frame_index"] for f in frames] == [0, 1, 2, 3, 4]
    usual = {f["frame_index"]: f["log_time_ns"] for f in found[1]["frames"]}
    assert [f["log_time_ns"] for f in frames] == [usual[5 * n] for n in range(5)]
    assert len(found[5]["observations"]) == len(found[5]["ground_truth"]) == 10
    notes = [d for d in found[5]["diagnostics"] if d["code"] == "frames_skipped"]
    assert len(notes) == 1
    assert "5 of 23" in notes[0]["message"]
    assert not [d for d in found[5]["diagnostics"] if d["code"].startswith("unpaired")]
    assert not [d for d in found[1]["diagnostics"] if d["code"] == "frames_skipped"]


def test_what_is_cut_is_chosen_from_the_beginning(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    write_crossings(path, 60)
    assert windows_by_index(path, Config(), 20.0)
    assert windows_by_index(path, every(5), 20.0) == ()


@pytest.mark.parametrize("count", [0, -1, 10**9])
def test_impossible_choices_are_refused(tmp_path: Path, count: int) -> None:
    with pytest.raises(UsageError, match="at least 1"):
        stadimeter.measure([tmp_path / "a.mcap"], tmp_path / "x.duckdb", every=count)
