"""A long recording on several cores: the same tables as by one, and what goes wrong in a window."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.core.config import Config
from pipeline.core.progress import Progress
from pipeline.mcap_file.writer import RecordingWriter, calibration_message, image_message
from pipeline.run.recordings import RunResult, run
from pipeline.run.windows import course
from pipeline.run.windows.course import usual_processes, windows_of
from pipeline.run.windows.split import WINDOW_S
from pipeline.store.database import Store
from tests.run.test_recordings import CAMERA, INTRINSICS, START_NS
from tests.run.windows.test_split import write_crossings

FRAME_NS = 400_000_000
SECONDS, SPLIT_S = 100, 50.0  # two windows


def write_walkers(path: Path, *, broken: int | None = None) -> None:
    """Two bodies that cross a street all the time, for the motion detector; 2.5 frames a second."""
    noise = np.random.default_rng(3)
    street = noise.integers(80, 140, (240, 320)).astype(np.uint8)
    street = cv2.GaussianBlur(street, (0, 0), 2)
    with RecordingWriter(path) as writer:
        writer.write("/calib", calibration_message(INTRINSICS, START_NS, CAMERA), START_NS)
        for index in range(SECONDS * 1_000_000_000 // FRAME_NS):
            picture = street.copy()
            for person, value in ((0, 220), (1, 20)):
                x = 10 + (index * 8 + 140 * person) % 290
                cv2.rectangle(picture, (x, 90), (x + 18, 150 + 40 * person), value, -1)
            data = cv2.imencode(".jpg", picture)[1].tobytes()
            time_ns = START_NS + index * FRAME_NS
            data = b"\xff\xd8broken" if index == broken else data
            writer.write("/image", image_message(data, "jpeg", time_ns, CAMERA), time_ns)


def hash_of(path: Path, database: Path, workers: int | None, split_s: float = SPLIT_S) -> str:
    """Hash of all tables of a recording, by so many processes."""
    result = run([path], database, Config(), workers=workers, window_s=split_s)
    assert [str(o.error) for o in result.failed] == []
    (outcome,) = result.stored
    assert outcome.tables_sha256
    return outcome.tables_sha256


def test_the_number_of_workers_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "walkers.mcap"
    write_walkers(path, broken=150)
    assert len(windows_of([path], Config(), SPLIT_S)[path]) == 2
    hashes = {n: hash_of(path, tmp_path / f"{n}.duckdb", n) for n in (1, 3)}
    assert len(set(hashes.values())) == 1, hashes
    whole = hash_of(path, tmp_path / "whole.duckdb", 1, 0.0)
    assert whole != hashes[1]  # or the test would not see that windows were used at all
    counts = "SELECT frame_count, frames_lost, content_sha256, damaged FROM recordings"
    tracks = "SELECT count(*) AS n FROM tracks"
    found = []
    for name in ("whole", "3"):
        with Store.open(tmp_path / f"{name}.duckdb", read_only=True) as store:
            found.append((store.query(counts).to_pylist(), store.query(tracks).to_pylist()))
    assert found[0] == found[1]
    assert found[0][0][0]["frames_lost"] == 1


def test_recorded_boxes_are_those_of_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    write_crossings(path, 130, named=True)
    estimates = "SELECT count(*) AS n, sum(depth_m) AS sum_m FROM estimates"
    found = []
    for split_s in (0.0, 65.0):
        database = tmp_path / f"{split_s}.duckdb"
        hash_of(path, database, 2, split_s)
        with Store.open(database, read_only=True) as store:
            found.append(store.query(estimates).to_pylist()[0])
    assert found[0]["n"] == found[1]["n"] > 0
    assert found[1]["sum_m"] == pytest.approx(found[0]["sum_m"], rel=1e-9)


def damaged_in_the_middle(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)


def test_damage_is_that_of_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "walkers.mcap"
    write_walkers(path)
    damaged_in_the_middle(path)
    assert windows_of([path], Config(), SPLIT_S)  # its index tells nothing of it
    cut = hash_of(path, tmp_path / "cut.duckdb", 2)
    whole = hash_of(path, tmp_path / "whole.duckdb", 1, 0.0)
    assert cut == whole
    with Store.open(tmp_path / "cut.duckdb", read_only=True) as store:
        assert store.query("SELECT damaged FROM recordings").to_pylist() == [{"damaged": True}]


def test_an_error_in_a_window_is_the_recordings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "long.mcap"
    write_crossings(path, 130)
    measured = course.work_window

    def fails_in_the_second(work, window):  # type: ignore[no-untyped-def]
        from pipeline.core.errors import StadimeterError

        return StadimeterError("is cursed") if window.number else measured(work, window)

    monkeypatch.setattr(course, "work_window", fails_in_the_second)
    result: RunResult = run([path], tmp_path / "x.duckdb", Config(), workers=1, window_s=65.0)
    assert result.stored == []
    assert [str(o.error).rstrip(".") for o in result.failed] == ["is cursed"]


def test_progress_of_windows_never_goes_back(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    write_crossings(path, 200)
    told: list[Progress] = []
    run([path], tmp_path / "x.duckdb", Config(), workers=1, window_s=50.0, report=told.append)
    shares = [p.fraction for p in told if p.stage == "measure"]
    assert shares == sorted(shares)
    assert len(set(shares)) >= 4
    assert told[-1].stage == "done"


def test_short_recordings_start_no_process(tmp_path: Path) -> None:
    path = tmp_path / "short.mcap"
    write_crossings(path, 30)
    assert windows_of([path], Config(), WINDOW_S) == {}
    assert usual_processes([path], {}) == 1
    assert usual_processes([path, path, tmp_path / "none.mcap"], {}) == 1
