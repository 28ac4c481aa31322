"""Videos taken as they are: the pictures bit for bit, in the order and at the times of the video."""

from __future__ import annotations

import builtins
import sys
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

import stadimeter
from pipeline.core.config import CameraConfig, Config
from pipeline.core.diagnostics import Notes
from pipeline.images.decode import decode
from pipeline.importing import video_packets
from pipeline.importing.video_file import UnreadableVideo, VideoImport
from pipeline.importing.video_packets import MustBeReencoded, start_time_ns, write_packets
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile

COUNT, STEP = 24, 9
CODERS = {
    "h264": ("libx264", {"bf": "2", "g": "8", "sc_threshold": "0"}),
    "hevc": ("libx265", {"x265-params": "bframes=2:keyint=8:log-level=none"}),
    "av1": ("libsvtav1", {"preset": "10", "crf": "20", "svtav1-params": "keyint=8"}),
    "vp9": ("libvpx-vp9", {"deadline": "realtime", "g": "8"}),
    "mpeg4": ("mpeg4", {}),
}
CONTAINERS = [
    ("h264", "mp4"),
    ("h264", "mov"),
    ("h264", "mkv"),
    ("h264", "ts"),
    ("h264", "avi"),
    ("hevc", "mp4"),
    ("hevc", "mkv"),
    ("av1", "mp4"),
    ("av1", "mkv"),
    ("vp9", "webm"),
]


def make(path: Path, codec: str, *, turned_deg: int = 0, flags: str = "", **metadata: str) -> Path:
    """Write a video whose pictures are brighter one by one."""
    encoder, options = CODERS[codec]
    with av.open(str(path), "w", options={"movflags": flags} if flags else {}) as container:
        container.metadata.update(metadata)
        stream = container.add_stream(encoder, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        if turned_deg:
            stream.set_display_rotation(turned_deg)
        for number in range(COUNT):
            picture = av.VideoFrame.from_ndarray(np.full((64, 96, 3), 10 + STEP * number, np.uint8))
            picture.pts, picture.time_base = number, Fraction(1, 25)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return path


def read(recording: Path) -> tuple[list[int], list[int], list[str]]:
    """Return number by brightness, and time in milliseconds, of the frames; and the diagnostics."""
    config, notes = Config(), Notes()
    frames = list(
        FrameAssembler(McapFile(recording, config.limits, notes.add), config.ingest, notes)
    )
    means = [
        decode(f.image, max_pixels=10**6, layout=f.layout, full_resolution=True).bgr.mean()
        for f in frames
    ]
    return (
        [round((mean - 10) / STEP) for mean in means],
        [round(frame.capture_time_ns / 1e6) for frame in frames],
        [note.code for note in notes],
    )


@pytest.mark.parametrize(("codec", "suffix"), CONTAINERS)
def test_every_container_gives_every_picture_at_its_time(
    codec: str, suffix: str, tmp_path: Path
) -> None:
    video = make(tmp_path / f"clip.{suffix}", codec)
    recording = tmp_path / "r.mcap"
    made = write_packets(video, recording, VideoImport(0, "c"), CameraConfig("c"), lambda _: None)
    assert (made.frame_count, made.remarks) == (COUNT, [])
    numbers, times_ms, codes = read(recording)
    assert codes == []
    assert numbers == list(range(COUNT))
    assert times_ms == pytest.approx([40 * n for n in range(COUNT)], abs=1)
    assert recording.stat().st_size < 3 * video.stat().st_size + 20_000


def test_the_pictures_are_those_of_the_video_bit_for_bit(tmp_path: Path) -> None:
    video = make(tmp_path / "clip.mp4", "h264")
    stadimeter.import_video(video, tmp_path / "r.mcap")
    with av.open(str(video)) as container:
        truth = [f.to_ndarray().tobytes() for f in container.decode(video=0)]
    config, notes = Config(), Notes()
    frames = FrameAssembler(
        McapFile(tmp_path / "r.mcap", config.limits, notes.add), config.ingest, notes
    )
    assert [bytes(frame.image) for frame in frames] == truth


@pytest.mark.parametrize(
    ("codec", "options", "word"),
    [("mpeg4", {}, "mpeg4"), ("h264", {"turned_deg": 90}, "turned by")],
)
def test_what_cannot_be_taken_becomes_jpeg_and_is_told(
    codec: str, options: dict[str, int], word: str, tmp_path: Path
) -> None:
    video = make(tmp_path / "clip.mp4", codec, **options)  # type: ignore[arg-type]
    with pytest.raises(MustBeReencoded, match=word):
        write_packets(video, tmp_path / "r", VideoImport(0, "c"), CameraConfig("c"), lambda _: None)
    made = stadimeter.import_video(video, tmp_path / "r.mcap")
    assert made.frame_count == COUNT
    assert word in " ".join(made.remarks)
    assert "JPEG" in " ".join(made.remarks)
    seen = stadimeter.inspect(tmp_path / "r.mcap").cameras[0]
    assert seen.picture == ("jpeg 64x96" if options else "jpeg 96x64")  # turned upright


def test_an_excerpt_begins_with_the_key_frame_before(tmp_path: Path) -> None:
    video = make(tmp_path / "clip.mp4", "h264")  # a key frame every 8 frames, 0.32 s
    made = stadimeter.import_video(
        video, tmp_path / "r.mcap", from_s=0.44, duration_s=0.2, start_time="1970-01-01T00:00:10Z"
    )
    numbers, times_ms, _ = read(tmp_path / "r.mcap")
    assert numbers[0] == 8
    assert times_ms[0] == 10_320
    assert set(range(11, 16)) <= set(numbers)
    assert max(numbers) <= 18  # a few that the last ones build on
    assert "0.12 s earlier" in " ".join(made.remarks)
    with pytest.raises(UnreadableVideo, match="no frame"):
        stadimeter.import_video(video, tmp_path / "late.mcap", from_s=99.0)
    assert not list(tmp_path.glob("late*"))


def test_a_frame_rate_that_is_given_goes_before_the_times(tmp_path: Path) -> None:
    video = make(tmp_path / "clip.mp4", "h264")
    stadimeter.import_video(
        video, tmp_path / "r.mcap", frame_rate=10.0, start_time="1970-01-01T00:00:00Z"
    )
    numbers, times_ms, _ = read(tmp_path / "r.mcap")
    assert numbers == list(range(COUNT))
    assert times_ms == [100 * n for n in range(COUNT)]


def test_a_video_that_was_cut_gives_what_is_there(tmp_path: Path) -> None:
    video = make(tmp_path / "clip.mp4", "h264", flags="+faststart")
    data = video.read_bytes()
    video.write_bytes(data[: len(data) - 300])
    made = stadimeter.import_video(video, tmp_path / "r.mcap")
    assert 8 <= made.frame_count < COUNT
    assert made.remarks  # that it is not all of it
    numbers, _, _ = read(tmp_path / "r.mcap")
    assert numbers[:8] == list(range(8))


def test_the_time_of_creation_is_taken_if_it_is_one(tmp_path: Path) -> None:
    stated = make(tmp_path / "a.mp4", "h264", creation_time="2026-03-01T08:00:00Z")
    assert start_time_ns(stated) == 1_772_352_000_000_000_000
    assert start_time_ns(make(tmp_path / "b.mp4", "h264")) is None
    dummy = make(tmp_path / "c.mp4", "h264", creation_time="1970-01-01T00:00:00Z")
    assert start_time_ns(dummy) is None
    (tmp_path / "d.mp4").write_bytes(b"none")
    assert start_time_ns(tmp_path / "d.mp4") is None


def test_without_the_library_the_video_becomes_jpeg_and_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    video = make(tmp_path / "clip.mp4", "h264")
    real = builtins.__import__

    def without_av(name: str, *arguments: object) -> object:
        if name == "av":
            raise ImportError(name)
        return real(name, *arguments)  # type: ignore[arg-type]

    monkeypatch.delitem(sys.modules, "av")
    monkeypatch.setattr(builtins, "__import__", without_av)
    monkeypatch.setattr(
        video_packets, "call_apart", lambda f, *a, report: f(*a, report)
    )  # where the library is missing too
    made = stadimeter.import_video(video, tmp_path / "r.mcap")
    assert made.frame_count == COUNT
    assert "av is not installed" in made.remarks[0]
    assert "video" in made.remarks[0]
