"""Videos, folders and patterns that are measured as recordings are."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import stadimeter
from pipeline.cli.main import main
from pipeline.core.errors import UsageError
from pipeline.run.recording_paths import recordings_of
from stadimeter.inputs import VIDEO_SUFFIXES, is_video
from tests.importing.test_video_packets import COUNT, make


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in" / "deep").mkdir(parents=True)
    make(tmp_path / "in" / "a.mp4", "h264")
    make(tmp_path / "in" / "deep" / "b.avi", "mpeg4")
    (tmp_path / "in" / "notes.txt").write_text("none")
    return tmp_path / "in"


def test_videos_are_found_in_folders_where_they_are_looked_for(folder: Path) -> None:
    a, b = folder / "a.mp4", folder / "deep" / "b.avi"
    assert recordings_of([folder], VIDEO_SUFFIXES) == [a, b]
    assert recordings_of([folder / "*.mp4", a, folder / "**" / "*.avi"]) == [a, b]
    with pytest.raises(UsageError, match=r"no \.mcap file"):
        recordings_of([folder])


def test_a_recording_is_no_video_whatever_its_name(tmp_path: Path) -> None:
    video = make(tmp_path / "a.mp4", "h264")
    assert is_video(video)
    made = stadimeter.import_video(video)
    assert made.path == tmp_path / "a.mcap"
    shutil.copy(made.path, tmp_path / "b.mp4")
    assert not is_video(tmp_path / "b.mp4")
    with pytest.raises(UsageError, match="already"):
        stadimeter.import_video(video)


def test_a_video_is_measured_and_its_recording_stays(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    database, camera = tmp_path / "out" / "d.duckdb", tmp_path / "camera.toml"
    camera.write_text('[[camera]]\nname = "yard"\nhfov_deg = 60.0\n')
    arguments = ["run", str(folder), "--db", str(database), "--camera", str(camera)]
    assert main(arguments) == 3  # nobody walks there
    told = capsys.readouterr()
    assert f"{tmp_path / 'out' / 'a.mcap'} made of a video, {COUNT} frames" in told.out
    assert "mpeg4" in told.err  # became JPEG
    with stadimeter.open(database) as results:
        rows = results.query("SELECT file_name, frame_count FROM recordings ORDER BY 1").rows()
        (lens,) = {r["fx_px"] for r in results.query("SELECT fx_px FROM cameras").rows()}
    assert [(r["file_name"], r["frame_count"]) for r in rows] == [
        ("a.mcap", COUNT),
        ("b.mcap", COUNT),
    ]
    assert lens == pytest.approx(
        48 / 0.57735, rel=1e-3
    )  # of the camera file, and not in the recording
    before = (tmp_path / "out" / "a.mcap").stat().st_mtime_ns
    main(arguments)
    assert "was made of this video before" in capsys.readouterr().out
    assert (tmp_path / "out" / "a.mcap").stat().st_mtime_ns == before


def test_the_recording_of_another_video_is_not_replaced(tmp_path: Path) -> None:
    video = make(tmp_path / "a.mp4", "h264")
    mine = tmp_path / "a.mcap"
    mine.write_bytes(b"mine")
    result = stadimeter.measure(video, tmp_path / "d.duckdb")
    assert mine.read_bytes() == b"mine"
    assert result.made[0].path.name.startswith("a-")
    assert [outcome.path for outcome in result.stored] == [result.made[0].path]


def test_a_video_that_cannot_be_read_costs_only_itself(tmp_path: Path) -> None:
    good, bad = make(tmp_path / "a.mp4", "h264"), tmp_path / "b.mp4"
    bad.write_bytes(b"none")
    result = stadimeter.measure([bad, good], tmp_path / "d.duckdb", strict=False)
    assert [outcome.path for outcome in result.failed] == [bad]
    assert len(result.stored) == 1
    assert not (tmp_path / "b.mcap").exists()
