"""Videos that end the process that decodes them, and the times of their frames."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from pipeline.core.config import CameraConfig, Config
from pipeline.core.diagnostics import Notes
from pipeline.importing import video_file
from pipeline.importing.video_file import FrameTimes, UnreadableVideo, VideoImport, import_video
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from tests.importing.aborting import aborting, exiting

CAMERA = CameraConfig("c")


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """Return a video of a rate that varies: frames at 0, 40, 80 ms, then every 100 ms."""
    path = tmp_path / "clip.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"bf": "0"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for number, time_ms in enumerate([0, 40, 80, *range(180, 1180, 100)]):
            picture = av.VideoFrame.from_ndarray(np.full((48, 64, 3), 9 * number, np.uint8))
            picture.pts, picture.time_base = time_ms, Fraction(1, 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def times_ms(recording: Path) -> list[float]:
    config = Config()
    file = McapFile(recording, config.limits, Notes().add)
    frames = FrameAssembler(file, config.ingest, Notes())
    return [frame.capture_time_ns / 1e6 for frame in frames]


def test_frames_keep_the_times_of_the_container(video: Path, tmp_path: Path) -> None:
    recording = tmp_path / "r.mcap"
    assert import_video(video, recording, VideoImport(0, "c"), CAMERA) == 13
    expected = [0, 40, 80, *range(180, 1180, 100)]
    assert times_ms(recording)[1:] == pytest.approx(expected[1:], abs=1.0)


def test_a_rate_that_is_given_goes_before_the_container(video: Path, tmp_path: Path) -> None:
    recording = tmp_path / "r.mcap"
    import_video(video, recording, VideoImport(10**9, "c", frame_rate=7.0), CAMERA)
    expected = [1000 + 1000 * n / 7 for n in range(13)]
    assert times_ms(recording) == pytest.approx(expected, abs=1e-3)


def test_an_excerpt_is_cut_by_these_times(video: Path, tmp_path: Path) -> None:
    recording = tmp_path / "r.mcap"
    options = VideoImport(0, "c", from_s=0.18, duration_s=0.35)
    assert import_video(video, recording, options, CAMERA) == 4
    assert times_ms(recording) == pytest.approx([180, 280, 380, 480], abs=1.0)


@pytest.mark.parametrize("function", [aborting, exiting])
def test_a_decoder_that_ends_its_process_costs_a_message(
    video: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: object
) -> None:
    monkeypatch.setattr(video_file, "write_recording", function)
    recording = tmp_path / "r.mcap"
    with pytest.raises(UnreadableVideo, match=r"clip\.mp4.*could not go on after") as caught:
        import_video(video, recording, VideoImport(0, "c"), CAMERA)
    assert [p.name for p in tmp_path.iterdir()] == ["clip.mp4"]
    if function is aborting:
        assert "after 2 frames" in str(caught.value)
        assert "SIGABRT (Assertion failed)" in str(caught.value)


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ([0.0, 0.1, 0.2], [0.0, 0.1, 0.2]),
        ([0.0, 0.0, 0.0], [0.0, 0.1, 0.2]),  # a container without times
        ([5.0, 5.1, 0.0, 5.3], [5.0, 5.1, 5.2, 5.3]),  # one that falls back
        ([float("nan"), 0.1], [0.0, 0.1]),
    ],
)
def test_frames_without_a_time_follow_at_the_frame_rate(
    stated: list[float], expected: list[float]
) -> None:
    times = FrameTimes(None, 10.0, Path("x.avi"))
    assert [times.next(s) for s in stated] == pytest.approx(expected)
