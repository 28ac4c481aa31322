"""Damaged files: the good part is kept, and every loss is told with its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType

from pipeline.config import Config, Limits
from pipeline.diagnostics import Notes
from pipeline.errors import NotARecording
from pipeline.ingest.frames import FrameAssembler
from pipeline.ingest.mcap_records import McapFile
from pipeline.ingest.mcap_writer import image_message
from pipeline.records import Severity
from tests.damage import SmallChunks, flipped, offsets

START_NS = 1_700_000_000_000_000_000
FRAMES = 40
KINDS = {
    "plain": CompressionType.NONE,
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
}


@pytest.fixture(params=[*KINDS])
def good(request: pytest.FixtureRequest, tmp_path: Path) -> bytes:
    path = tmp_path / "good.mcap"
    random = np.random.default_rng(0)
    with SmallChunks(path, compression=KINDS[request.param]) as w:
        for index in range(FRAMES):
            time_ns = START_NS + index * 40_000_000
            picture = image_message(random.bytes(1500), "jpeg", time_ns, "cam")
            w.write("/i", picture, time_ns)
    return path.read_bytes()


def read(data: bytes, tmp_path: Path, limits: Limits | None = None) -> tuple[int, Notes, int]:
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    config, notes = Config(), Notes()
    assembler = FrameAssembler(
        McapFile(path, limits or config.limits, notes.add), config.ingest, notes
    )
    return len(list(assembler)), notes, assembler.frames_lost


def codes(notes: Notes) -> set[str]:
    return {note.code for note in notes}


def test_a_good_file_has_nothing_to_tell(good: bytes, tmp_path: Path) -> None:
    frames, notes, lost = read(good, tmp_path)
    assert (frames, len(notes), lost) == (FRAMES, 0, 0)


def test_a_flipped_byte_costs_its_chunk(good: bytes, tmp_path: Path) -> None:
    chunks = offsets(good, Opcode.CHUNK)
    at, length = chunks[len(chunks) // 2]
    frames, notes, lost = read(flipped(good, at + length - 40), tmp_path)
    assert 0 < frames < FRAMES
    assert frames + lost == FRAMES
    bad = next(n for n in notes if n.code == "damaged_chunk")
    assert bad.severity is Severity.ERROR
    assert bad.byte_offset == at
    assert bad.log_time_ns is not None
    assert START_NS < bad.log_time_ns <= (bad.end_time_ns or 0)


def test_a_truncated_file_keeps_every_whole_chunk(good: bytes, tmp_path: Path) -> None:
    chunks = offsets(good, Opcode.CHUNK)
    at, length = chunks[3]
    frames, notes, _ = read(good[: at + length // 2], tmp_path)
    whole, _, _ = read(good[:at], tmp_path)
    assert frames >= whole > 0
    note = next(n for n in notes if n.code == "truncated_file")
    assert note.byte_offset == at


def test_a_cut_at_any_byte_is_told_and_does_no_harm(good: bytes, tmp_path: Path) -> None:
    for cut in np.linspace(8, len(good) - 1, 60).astype(int):
        frames, notes, _ = read(good[:cut], tmp_path)
        assert frames <= FRAMES
        assert "truncated_file" in codes(notes) or frames == FRAMES


def test_a_flipped_length_resumes_at_the_next_chunk_of_the_index(
    good: bytes, tmp_path: Path
) -> None:
    chunks = offsets(good, Opcode.CHUNK)
    at, _ = chunks[2]
    frames, notes, _ = read(flipped(good, at + 8, 0x7F), tmp_path)
    assert frames > FRAMES // 2
    assert notes.lost_data


def test_any_flipped_byte_is_noticed_or_harmless(good: bytes, tmp_path: Path) -> None:
    for at in np.linspace(8, len(good) - 9, 80).astype(int):
        frames, notes, _ = read(flipped(good, int(at), 0x55), tmp_path)
        assert frames == FRAMES or notes.lost_data or codes(notes)


@pytest.mark.parametrize(
    ("data", "word"),
    [(b"", "empty"), (b"\x89MCAP0\r", "not an MCAP"), (b"\xff\xd8\xff\xe0" * 10, "not an MCAP")],
)
def test_what_is_no_recording_is_said_to_be_none(data: bytes, word: str, tmp_path: Path) -> None:
    with pytest.raises(NotARecording, match=word):
        read(data, tmp_path)


def test_a_chunk_that_claims_too_much_is_left_out(good: bytes, tmp_path: Path) -> None:
    limits = Limits(chunk_bytes=100)
    frames, notes, _ = read(good, tmp_path, limits)
    assert frames == 0
    assert "damaged_chunk" in codes(notes)


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_chunk_that_expands_beyond_its_claim_takes_no_memory(
    compression: str, tmp_path: Path
) -> None:
    import struct
    import tracemalloc

    import lz4.frame
    import zstandard

    bomb = b"\0" * 200_000_000
    packed = lz4.frame.compress(bomb) if compression == "lz4" else zstandard.compress(bomb)
    name = compression.encode()
    body = struct.pack("<QQQI", 0, 1, 1000, 0) + struct.pack("<I", len(name)) + name
    body += struct.pack("<Q", len(packed)) + packed
    data = b"\x89MCAP0\r\n" + struct.pack("<BQ", Opcode.CHUNK, len(body)) + body
    del bomb
    tracemalloc.start()
    frames, notes, _ = read(data, tmp_path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert frames == 0
    assert "damaged_chunk" in codes(notes)
    assert peak < 50_000_000


def test_a_message_that_is_no_message_is_left_out(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        w = Writer(stream)
        w.start()
        schema = w.register_schema("foxglove.CompressedImage", "protobuf", b"")
        channel = w.register_channel("/i", "protobuf", schema)
        w.add_message(channel, 5, b"\xff\xff\xff\xff", 5)
        good = image_message(b"x", "jpeg", 6, "cam").SerializeToString()
        w.add_message(channel, 6, good, 6)
        w.add_message(channel, 2**64 - 1, good, 6)
        w.finish()
    frames, notes, _ = read(path.read_bytes(), tmp_path)
    assert frames == 1
    assert codes(notes) == {"damaged_message", "invalid_time"}
