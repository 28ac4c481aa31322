"""Damaged files: the good part is kept, and every loss is told with its place."""

from __future__ import annotations

import hashlib
import struct
import time
import tracemalloc
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from pipeline.core.config import Config, Limits
from pipeline.core.diagnostics import Notes
from pipeline.core.errors import NotARecording
from pipeline.core.records import Severity
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.writer import image_message
from tests.support.damage import (
    DAMAGES,
    FRAMES,
    MAGIC,
    START_NS,
    chunk_record,
    flipped,
    offsets,
    put,
    records,
    write_good,
)

KINDS = {
    "plain": CompressionType.NONE,
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
}


@pytest.fixture(scope="module", params=[*KINDS])
def good(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("good") / "good.mcap"
    return write_good(path, KINDS[request.param])


@pytest.fixture(scope="module")
def unchunked(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("good") / "unchunked.mcap"
    return write_good(path, CompressionType.NONE, chunked=False)


def read(data: bytes, tmp_path: Path, limits: Limits | None = None) -> tuple[int, Notes, int]:
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    config, notes = Config(), Notes()
    file = McapFile(path, limits or config.limits, notes.add)
    assembler = FrameAssembler(file, config.ingest, notes)
    count = len(list(assembler))
    assert file.content_sha256 == hashlib.sha256(data).hexdigest()
    return count, notes, assembler.frames_lost


def codes(notes: Notes) -> set[str]:
    return {note.code for note in notes}


def test_a_good_file_has_nothing_to_tell(good: bytes, tmp_path: Path) -> None:
    frames, notes, lost = read(good, tmp_path)
    assert (frames, len(notes), lost) == (FRAMES, 0, 0)


@pytest.mark.parametrize("name", [*DAMAGES])
def test_named_damage_costs_what_it_must_and_is_told(
    name: str, good: bytes, tmp_path: Path
) -> None:
    damaged = DAMAGES[name](good)
    frames, notes, lost = read(damaged.data, tmp_path)
    found = [(n.code, n.byte_offset, n.message) for n in notes]
    assert FRAMES - damaged.lost <= frames <= FRAMES, found
    if damaged.counted:
        assert frames + lost == FRAMES, found
    if not damaged.told:
        assert not found
        return
    assert not damaged.codes or codes(notes) & damaged.codes, found
    first = min(n.byte_offset for n in notes if n.byte_offset is not None)
    assert first <= damaged.at, found
    harmless = {"unknown_record", "another_recording", "repeated_chunk"}
    assert notes.lost_data or codes(notes) <= harmless


def test_a_loss_says_where_and_when(good: bytes, tmp_path: Path) -> None:
    chunks = offsets(good, Opcode.CHUNK)
    at, length = chunks[len(chunks) // 2]
    _, notes, lost = read(flipped(good, at + length - 40), tmp_path)
    bad = next(n for n in notes if n.code == "damaged_chunk")
    assert bad.severity is Severity.ERROR
    assert bad.byte_offset == at
    assert bad.log_time_ns is not None
    assert START_NS < bad.log_time_ns <= (bad.end_time_ns or 0)
    gone = next(n for n in notes if n.code == "lost_messages" and n.topic == "/i")
    assert (gone.count, gone.byte_offset, gone.log_time_ns) == (lost, at, bad.log_time_ns)
    _, notes, _ = read(put(flipped(good, at + length - 40), at, b"\x00"), tmp_path)
    gap = next(n for n in notes if n.code == "lost_place")
    assert gap.byte_offset == at
    assert START_NS < (gap.log_time_ns or 0) <= (gap.end_time_ns or 0)


def test_a_cut_chunk_keeps_the_messages_before_the_cut(good: bytes, tmp_path: Path) -> None:
    at, length = offsets(good, Opcode.CHUNK)[3]
    before, _, _ = read(good[:at], tmp_path)
    frames, notes, _ = read(good[: at + 9 + length - 30], tmp_path)
    note = next(n for n in notes if n.code == "truncated_file")
    assert note.byte_offset == at
    assert note.log_time_ns is not None
    # lz4 and zstd give whole blocks; random bytes of this size fit in one.
    assert frames > before or "0 messages" in note.message


def test_a_cut_at_any_byte_keeps_every_whole_chunk_before_it(good: bytes, tmp_path: Path) -> None:
    chunks = offsets(good, Opcode.CHUNK)
    whole = {at + 9 + length: None for at, length in chunks}
    counts = [read(good[:end], tmp_path)[0] for end in whole]
    for cut in np.linspace(8, len(good) - 1, 60).astype(int):
        frames, notes, _ = read(good[:cut], tmp_path)
        before = [c for end, c in zip(whole, counts, strict=True) if end <= cut]
        assert (before or [0])[-1] <= frames <= FRAMES
        assert "truncated_file" in codes(notes)
        assert "bytes_after_end" not in codes(notes)


def test_any_flipped_byte_is_noticed_and_costs_one_chunk_at_most(
    good: bytes, tmp_path: Path
) -> None:
    largest = 5
    for at in np.linspace(8, len(good) - 1, 120).astype(int):
        for mask in (0x01, 0xFF):
            frames, notes, lost = read(flipped(good, int(at), mask), tmp_path)
            assert codes(notes), at
            assert frames >= FRAMES - largest, (at, list(notes))
            assert frames + lost >= FRAMES, (at, list(notes))


def test_any_flipped_byte_of_a_file_without_chunks_costs_little(
    unchunked: bytes, tmp_path: Path
) -> None:
    for at in np.linspace(8, len(unchunked) - 1, 150).astype(int):
        for mask in (0x01, 0xFF):
            frames, notes, lost = read(flipped(unchunked, int(at), mask), tmp_path)
            assert codes(notes), at
            assert frames >= FRAMES - 2, (at, list(notes))
            assert frames + lost >= FRAMES, (at, list(notes))


def test_a_message_length_over_the_next_messages_costs_that_message(
    unchunked: bytes, tmp_path: Path
) -> None:
    at, length = offsets(unchunked, Opcode.MESSAGE)[21]
    data = put(unchunked, at + 1, struct.pack("<Q", length + 2500))
    frames, notes, _ = read(data, tmp_path)
    assert frames >= FRAMES - 1
    assert "lost_place" in codes(notes)


def test_the_order_of_records_in_the_kit_is_that_of_the_format(good: bytes) -> None:
    opcodes = [opcode for opcode, _, _ in records(good)]
    assert opcodes[0] == Opcode.HEADER
    assert opcodes[-1] == Opcode.FOOTER


def test_a_channel_without_its_record_is_taken_from_the_summary(
    good: bytes, tmp_path: Path
) -> None:
    at, length = offsets(good, Opcode.CHUNK)[0]
    data = put(good, at, bytes(9 + length))
    frames, notes, lost = read(data, tmp_path)
    assert frames + lost == FRAMES
    assert frames > FRAMES // 2
    assert "unknown_channel" not in codes(notes)


def test_messages_of_a_channel_that_nothing_declares_are_told(good: bytes, tmp_path: Path) -> None:
    at, length = offsets(good, Opcode.CHUNK)[0]
    end, _ = offsets(good, Opcode.DATA_END)[0]
    data = put(good, at, bytes(9 + length))[:end]
    frames, notes, _ = read(data, tmp_path)
    assert frames == 0
    assert "unknown_channel" in codes(notes)


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"", "empty"),
        (b"\x89MCAP0\r", "not an MCAP"),
        (b"\xff\xd8\xff\xe0" * 10, "not an MCAP"),
        (b"\x28\xb5\x2f\xfd" * 10, "zstd -d"),
        (b"#ROSBAG V2.0\n", "mcap convert"),
        (b"SQLite format 3\0", "ros2 bag convert"),
    ],
)
def test_what_is_no_recording_is_said_to_be_none(data: bytes, word: str, tmp_path: Path) -> None:
    with pytest.raises(NotARecording, match=word):
        read(data, tmp_path)


def test_a_chunk_that_claims_too_much_is_left_out(good: bytes, tmp_path: Path) -> None:
    frames, notes, lost = read(good, tmp_path, Limits(chunk_bytes=100))
    assert (frames, lost) == (0, FRAMES)
    assert "damaged_chunk" in codes(notes)


def test_a_record_over_the_limit_is_passed_over(good: bytes, tmp_path: Path) -> None:
    frames, notes, lost = read(good, tmp_path, Limits(record_bytes=3000))
    assert codes(notes) >= {"oversized_record"}
    assert frames + lost == FRAMES


BOMB = 80_000_000


def _bomb(compression: str) -> bytes:
    zeros = b"\0" * BOMB
    if compression == "lz4":
        return lz4.frame.compress(zeros)
    if compression == "zstd":
        return zstandard.compress(zeros)
    stream = zstandard.ZstdCompressor().compressobj()  # a frame that does not say how much it holds
    return stream.compress(zeros) + stream.flush()


@pytest.mark.parametrize("compression", ["lz4", "zstd", "zstd_stream"])
def test_a_chunk_that_expands_beyond_its_claim_takes_no_memory(
    compression: str, tmp_path: Path
) -> None:
    data = MAGIC + chunk_record(compression.removesuffix("_stream"), _bomb(compression), 1000)
    tracemalloc.start()
    frames, notes, _ = read(data, tmp_path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert frames == 0
    assert "damaged_chunk" in codes(notes)
    assert peak < 30_000_000


@pytest.mark.parametrize("compression", ["lz4", "zstd", "zstd_stream"])
def test_a_cut_chunk_expands_no_further_than_the_limit(compression: str, tmp_path: Path) -> None:
    whole = chunk_record(compression.removesuffix("_stream"), _bomb(compression), BOMB)
    tracemalloc.start()
    read(MAGIC + whole[:-3], tmp_path, Limits(chunk_bytes=10_000_000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60_000_000


@pytest.mark.parametrize("opcode", [Opcode.MESSAGE, Opcode.SCHEMA, 0x90, 0x00])
def test_a_small_chunk_of_millions_of_empty_records_takes_no_time(
    opcode: int, tmp_path: Path
) -> None:
    inside = struct.pack("<BQ", opcode, 0) * 1_000_000
    data = MAGIC + chunk_record("zstd", zstandard.compress(inside), len(inside))
    assert len(data) < 5_000
    started = time.process_time()
    frames, notes, _ = read(data, tmp_path)
    assert time.process_time() - started < 20  # about 2 s; a guard against minutes, not a speed
    assert frames == 0
    assert len(notes) < 10


def test_a_zstd_chunk_of_several_frames_is_read(tmp_path: Path) -> None:
    message = image_message(b"x", "jpeg", START_NS, "cam").SerializeToString()
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        w = Writer(stream, compression=CompressionType.NONE)
        w.start()
        schema = w.register_schema("foxglove.CompressedImage", "protobuf", b"")
        w.add_message(w.register_channel("/i", "protobuf", schema), 5, message, 5)
        w.finish()
    plain = path.read_bytes()
    at, length = offsets(plain, Opcode.CHUNK)[0]
    inside = plain[at + 9 + 40 : at + 9 + length]
    for compress, name in ((zstandard.compress, "zstd"), (lz4.frame.compress, "lz4")):
        packed = compress(inside[:20]) + compress(inside[20:])
        data = plain[:at] + chunk_record(name, packed, len(inside)) + plain[at + 9 + length :]
        frames, _, _ = read(data, tmp_path)
        assert frames == 1


def test_a_message_that_is_no_message_is_left_out(tmp_path: Path) -> None:
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
    frames, notes, lost = read(path.read_bytes(), tmp_path)
    assert (frames, lost) == (1, 2)
    assert codes(notes) == {"damaged_message", "invalid_time"}
