"""Video streams: every codec, B-frames, and what a loss costs."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.images.raw import decode_raw
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.video.access_units import Times
from pipeline.ingest.video.video_stream import Out, VideoStream, is_key_frame
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import timestamp
from tests.support.damage import SmallChunks, flipped

COUNT, KEY_EVERY, STEP = 40, 10, 6
WITHOUT_B = {
    "h264": ("libx264", {"bf": "0"}),
    "hevc": ("libx265", {"x265-params": f"bframes=0:log-level=none:keyint={KEY_EVERY}"}),
    "vp9": ("libvpx-vp9", {"deadline": "realtime", "lag-in-frames": "0"}),
    "av1": (
        "libsvtav1",
        {"preset": "10", "crf": "15", "svtav1-params": f"pred-struct=1:keyint={KEY_EVERY}"},
    ),
}
WITH_B = {
    "h264": ("libx264", {"bf": "2"}),
    "hevc": ("libx265", {"x265-params": f"bframes=2:log-level=none:keyint={KEY_EVERY}"}),
}
Packet = tuple[int, bytes]


def encoded(encoder: str, options: dict[str, str], width: int = 128) -> list[Packet]:
    """Return packets as the encoder gives them: when each is shown, and its bytes."""
    context = av.CodecContext.create(encoder, "w")
    context.width, context.height, context.pix_fmt = width, 96, "yuv420p"
    context.time_base, context.framerate = Fraction(1, 25), Fraction(25)
    context.gop_size, context.options = KEY_EVERY, options
    packets = []
    for index in range(COUNT):  # its brightness tells which frame it is
        picture = av.VideoFrame.from_ndarray(
            np.full((96, width, 3), 10 + STEP * index, np.uint8), format="bgr24"
        )
        picture = picture.reformat(format="yuv420p")
        picture.pts = index
        packets += context.encode(picture)
    packets += context.encode(None)
    return [(packet.pts, bytes(packet)) for packet in packets]


def index_of(out: Out[int]) -> int | None:
    if out.image.layout is None:
        return None
    mean = decode_raw(out.image.data, out.image.layout).mean()
    return round((mean - 10) / STEP)


def run(codec: str, packets: list[Packet], *, shown: bool = True) -> list[Out[int]]:
    stream: VideoStream[int] = VideoStream(codec, 10**6)
    outs = []
    for number, (pts, data) in enumerate(packets):
        outs += stream.decode(data, number, Times(number, pts if shown else number))
    return outs + list(stream.flush())


@pytest.mark.parametrize("codec", WITHOUT_B)
def test_every_codec(codec: str) -> None:
    packets = encoded(*WITHOUT_B[codec])
    keys = [i for i, (_, data) in enumerate(packets) if is_key_frame(codec, data)]
    assert keys == list(range(0, COUNT, KEY_EVERY))
    assert [index_of(out) for out in run(codec, packets)] == list(range(COUNT))


@pytest.mark.parametrize("codec", WITH_B)
@pytest.mark.parametrize("shown", [True, False])
def test_frames_with_b_frames_come_in_the_order_of_time(codec: str, shown: bool) -> None:
    packets = encoded(*WITH_B[codec])
    assert [pts for pts, _ in packets] != sorted(pts for pts, _ in packets)
    outs = run(codec, packets, shown=shown)
    assert [index_of(out) for out in outs] == list(range(COUNT))
    assert [out.times.capture_time_ns for out in outs] == list(range(COUNT))
    assert [out.times.log_time_ns for out in outs] == list(range(COUNT))


def test_a_stream_resumes_at_the_next_key_frame() -> None:
    packets = encoded(*WITHOUT_B["h264"])
    stream: VideoStream[int] = VideoStream("h264", 10**6)
    outs = []
    for number, (pts, data) in enumerate(packets):
        if number == 13:  # lost with a damaged chunk
            outs += stream.lose()
            continue
        outs += stream.decode(data, number, Times(number, pts))
    outs += stream.flush()
    good = [out for out in outs if not out.problem]
    assert [index_of(out) for out in good] == [*range(13), *range(20, COUNT)]
    assert [out.item for out in outs if out.problem] == [*range(14, 20)]
    assert len(outs) == COUNT - 1


def test_a_stream_that_starts_between_key_frames_waits_for_one() -> None:
    outs = run("h264", encoded(*WITHOUT_B["h264"])[5:])
    assert [bool(out.problem) for out in outs] == [True] * 5 + [False] * 30
    assert "no key frame" in outs[0].problem


def test_a_picture_larger_than_is_allowed_takes_no_memory() -> None:
    stream: VideoStream[int] = VideoStream("h264", 1000)
    packets = encoded(*WITHOUT_B["h264"])
    outs = [o for n, (p, d) in enumerate(packets) for o in stream.decode(d, n, Times(n, p))]
    assert all(out.problem for out in [*outs, *stream.flush()])


@settings(max_examples=30)
@given(st.sampled_from([*WITHOUT_B]), st.lists(st.binary(max_size=300), max_size=5), st.booleans())
def test_any_bytes_are_a_loss_and_no_more(codec: str, junk: list[bytes], key: bool) -> None:
    start = {"h264": b"\0\0\1\x65", "hevc": b"\0\0\1\x26", "vp9": b"\x82", "av1": b"\x0a\x01"}
    packets = [(i, (start[codec] if key else b"") + data) for i, data in enumerate(junk)]
    outs = run(codec, packets)
    assert all(out.problem for out in outs)
    if codec in ("av1", "vp9"):  # of the others, one message need not be one picture
        assert len(outs) == len(packets)


def write_video(path: Path, packets: list[Packet], codec: str = "h264") -> None:
    with SmallChunks(path) as writer:
        for pts, data in packets:
            time_ns = 10**18 + pts * 40_000_000
            message = CompressedVideo(
                timestamp=timestamp(time_ns), frame_id="cam", data=data, format=codec
            )
            writer.write("/video", message, time_ns)


def frames_of(path: Path):
    config, notes = Config(), Notes()
    assembler = FrameAssembler(McapFile(path, config.limits, notes.add), config.ingest, notes)
    return list(assembler), notes, assembler


def noisy() -> list[Packet]:
    """Return packets of some size, so that a file has several chunks."""
    random = np.random.default_rng(1)
    context = av.CodecContext.create("libx264", "w")
    context.width, context.height, context.pix_fmt = 128, 96, "yuv420p"
    context.time_base, context.framerate, context.gop_size = Fraction(1, 25), Fraction(25), 10
    context.options = {"bf": "0", "crf": "18", "sc_threshold": "0"}
    packets = []
    for index in range(COUNT):
        pixels = random.integers(0, 255, (96, 128, 3), dtype=np.uint8)
        picture = av.VideoFrame.from_ndarray(pixels, format="bgr24").reformat(format="yuv420p")
        picture.pts = index
        packets += context.encode(picture)
    return [(p.pts, bytes(p)) for p in [*packets, *context.encode(None)]]


def test_a_damaged_chunk_costs_the_frames_up_to_the_next_key_frame(tmp_path: Path) -> None:
    whole, path = tmp_path / "good.mcap", tmp_path / "bad.mcap"
    packets = noisy()
    write_video(whole, packets)
    frames, notes, _ = frames_of(whole)
    assert [bool(f.image) for f in frames] == [True] * COUNT
    assert not list(notes)
    data = whole.read_bytes()
    path.write_bytes(flipped(data, data.index(packets[12][1]) + 60))
    frames, notes, assembler = frames_of(path)
    shown = [(f.capture_time_ns - 10**18) // 40_000_000 for f in frames if f.image]
    assert shown[:5] == [0, 1, 2, 3, 4]
    assert shown[-20:] == list(range(20, 40))
    assert {"damaged_chunk", "video_gap"} <= {n.code for n in notes}
    left_out = sum(not f.image for f in frames)
    assert len(shown) + left_out + assembler.frames_lost == COUNT


def test_without_the_library_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    write_video(tmp_path / "x.mcap", encoded(*WITHOUT_B["h264"]))
    monkeypatch.setitem(sys.modules, "av", None)
    frames, notes, assembler = frames_of(tmp_path / "x.mcap")
    assert (frames, assembler.frames_lost) == ([], COUNT)
    (note,) = notes
    assert (note.code, note.count) == ("missing_library", COUNT)
    assert ".[video]" in note.message
