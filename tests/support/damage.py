"""A corruption kit: damaged files, each with a name, made of a good one.

for name, make in DAMAGES.items():
    damaged = make(good)         # the bytes, where they were damaged, what is lost at most
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from pipeline.mcap_file.writer import RecordingWriter, image_message, timestamp
from schemas.stadimeter_pb2 import CameraExposure

MAGIC = b"\x89MCAP0\r\n"
MAGIC_BYTES = len(MAGIC)
START_NS = 1_700_000_000_000_000_000
FRAME_NS = 40_000_000
FRAMES = 40


# Finding one's way


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, offset and length of every record outside chunks."""
    at = MAGIC_BYTES
    while at + 9 <= len(data) - MAGIC_BYTES:
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield opcode, at, length
        at += 9 + length


def offsets(data: bytes, opcode: Opcode) -> list[tuple[int, int]]:
    return [(at, length) for op, at, length in records(data) if op == opcode]


def middle(data: bytes, opcode: Opcode) -> tuple[int, int]:
    found = offsets(data, opcode)
    return found[len(found) // 2]


def frames_in_chunk(data: bytes, at: int) -> int:
    """Return how many pictures (messages of channel 1) the index behind a chunk counts."""
    for opcode, offset, _ in records(data):
        if offset > at and opcode == Opcode.CHUNK:
            break
        if offset > at and opcode == Opcode.MESSAGE_INDEX:
            channel, size = struct.unpack_from("<HI", data, offset + 9)
            if channel == 1:
                return size // 16
    return 0


# Tools


def flipped(data: bytes, at: int, mask: int = 0xFF) -> bytes:
    return data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :]


def put(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


def insert(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at:]


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def chunk_record(compression: str, packed: bytes, size: int, crc: int = 0) -> bytes:
    name = compression.encode()
    head = struct.pack("<QQQII", START_NS, START_NS + 1000, size, crc, len(name)) + name
    return record(Opcode.CHUNK, head + struct.pack("<Q", len(packed)) + packed)


class SmallChunks(RecordingWriter):
    """Writes chunks of a few messages, so that a little damage costs a little."""

    def __init__(
        self,
        path: Path,
        *,
        compression: CompressionType = CompressionType.NONE,
        chunked: bool = True,
        chunk_size: int = 6_000,
    ) -> None:
        super().__init__(path)
        self._writer = Writer(
            self._stream,
            chunk_size=chunk_size,
            compression=compression,
            use_chunking=chunked,
            enable_data_crcs=True,
        )
        self._stream.seek(0)
        self._stream.truncate()
        self._writer.start(profile="", library="test")


def write_good(path: Path, compression: CompressionType, *, chunked: bool = True) -> bytes:
    """Write pictures with exposures, an attachment and metadata; return the bytes."""
    random = np.random.default_rng(0)
    with SmallChunks(path, compression=compression, chunked=chunked) as w:
        for index in range(FRAMES):
            time_ns = START_NS + index * FRAME_NS
            w.write("/i", image_message(random.bytes(1500), "jpeg", time_ns, "cam"), time_ns)
            exposure = CameraExposure(timestamp=timestamp(time_ns), frame_id="cam", f_number=2.8)
            w.write("/e", exposure, time_ns)
        w.add_metadata("m", {"place": "yard"})
        w.add_attachment("a.bin", "application/octet-stream", random.bytes(300), START_NS)
    return path.read_bytes()


# The kit


@dataclass(frozen=True)
class Damaged:
    """A damaged file, and what must be true of reading it."""

    data: bytes
    at: int  # where the first diagnostic must point, at most this
    lost: int = 0  # pictures that may be missing, at most
    counted: bool = True  # whether the reader can know how many
    codes: frozenset[str] = field(default_factory=frozenset)  # one of them must be told
    told: bool = True  # whether anything must be told at all


def _damaged(data: bytes, at: int, *codes: str, **what: object) -> Damaged:
    return Damaged(data, at, codes=frozenset(codes), **what)  # type: ignore[arg-type]


def flipped_chunk_data(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.CHUNK)
    data = flipped(good, at + length - 40)
    return _damaged(data, at, "damaged_chunk", lost=frames_in_chunk(good, at))


def flipped_first_chunk(good: bytes) -> Damaged:
    """The chunk that declares the schemas and channels; only the summary repeats them."""
    at, length = offsets(good, Opcode.CHUNK)[0]
    data = flipped(good, at + length - 40)
    return _damaged(data, at, "damaged_chunk", lost=frames_in_chunk(good, at))


def flipped_chunk_crc(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    data = flipped(good, at + 9 + 24, 1)
    return _damaged(data, at, "damaged_chunk", lost=frames_in_chunk(good, at))


def wrong_uncompressed_size(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    data = flipped(good, at + 9 + 16, 0x07)
    return _damaged(data, at, "wrong_chunk_head")


def uncompressed_size_of_terabytes(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    data = put(good, at + 9 + 16, struct.pack("<Q", 1 << 42))
    return _damaged(data, at, "wrong_chunk_head")


def unknown_compression(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    size = int.from_bytes(good[at + 9 + 28 : at + 9 + 32], "little")
    if size == 0:  # there is no name to change: a length of records that is too large
        data = flipped(good, at + 9 + 32 + 6, 0x01)
    else:
        data = put(good, at + 9 + 32, b"q" * size)
    return _damaged(data, at, "wrong_chunk_head")


def chunk_length_too_large(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(flipped(good, at + 8, 0x7F), at, "wrong_length", "lost_place")


def chunk_length_too_small(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.CHUNK)
    data = put(good, at + 1, struct.pack("<Q", length - 100))
    return _damaged(data, at, "wrong_length", "lost_place")


def chunk_length_over_the_next(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.CHUNK)
    data = put(good, at + 1, struct.pack("<Q", length + 1000))
    return _damaged(data, at, "wrong_length", "lost_place")


def zero_chunk_length(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    data = put(good, at + 1, struct.pack("<Q", 0))
    return _damaged(data, at, "wrong_length", "lost_place")


def chunk_opcode_gone(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(put(good, at, b"\x00"), at, "wrong_opcode")


def chunk_opcode_unknown(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(put(good, at, b"\x77"), at, "wrong_opcode")


def chunk_opcode_another(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(put(good, at, bytes([Opcode.CHANNEL])), at, "wrong_opcode")


def chunk_opcode_a_message_s(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(put(good, at, bytes([Opcode.MESSAGE])), at, "wrong_opcode")


def chunk_repeated(good: bytes) -> Damaged:
    """The same chunk twice, as a copy that was resumed too early leaves it."""
    at, length = middle(good, Opcode.CHUNK)
    end = at + 9 + length
    return _damaged(insert(good, end, good[at:end]), end, "repeated_chunk")


def first_chunk_and_a_byte_gone(good: bytes) -> Damaged:
    """No offset of the summary fits any more, and it alone repeats the declarations."""
    at, length = offsets(good, Opcode.CHUNK)[0]
    lost = frames_in_chunk(good, at)
    damaged = flipped(good, at + length - 40)
    later, _ = offsets(good, Opcode.CHUNK)[2]
    lost += frames_in_chunk(good, later)
    return _damaged(damaged[: later + 200] + damaged[later + 201 :], at, "damaged_chunk", lost=lost)


def flipped_message_index(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.MESSAGE_INDEX)
    return _damaged(flipped(good, at + 9 + 8), len(good), "data_crc")


def message_index_length(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.MESSAGE_INDEX)
    return _damaged(flipped(good, at + 4), at, "wrong_length", "lost_place")


def flipped_attachment(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.ATTACHMENT)
    return _damaged(flipped(good, at + length - 100), at, "damaged_attachment")


def flipped_attachment_length(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.ATTACHMENT)
    return _damaged(flipped(good, at + 8), at, "wrong_length")


def flipped_metadata(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.METADATA)
    return _damaged(flipped(good, at + 9 + length - 1, 0x20), len(good), "data_crc")


def metadata_map_too_large(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.METADATA)
    data = put(good, at + 9 + 5, struct.pack("<I", 2**32 - 1))
    return _damaged(data, at, "damaged_record")


def flipped_header(good: bytes) -> Damaged:
    return _damaged(flipped(good, MAGIC_BYTES + 9 + 9, 0x20), len(good), "data_crc")


def flipped_data_end(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.DATA_END)
    return _damaged(flipped(good, at + 9), at, "data_crc")


def flipped_summary_schema(good: bytes) -> Damaged:
    at = max(o for o, _ in offsets(good, Opcode.SCHEMA))
    return _damaged(flipped(good, at + 9 + 8, 0x20), len(good), "summary_crc")


def flipped_statistics(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.STATISTICS)
    return _damaged(flipped(good, at + 9 + 2), len(good), "summary_crc")


def flipped_chunk_index(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK_INDEX)
    return _damaged(flipped(good, at + 9 + 17), len(good), "summary_crc")


def flipped_footer(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.FOOTER)
    return _damaged(flipped(good, at + 9), at, "summary_crc")


def flipped_closing_magic(good: bytes) -> Damaged:
    return _damaged(flipped(good, len(good) - 3), len(good), "truncated_file")


def missing_footer(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.FOOTER)
    return _damaged(good[:at], at, "truncated_file")


def missing_closing_magic(good: bytes) -> Damaged:
    return _damaged(good[:-MAGIC_BYTES], len(good), "truncated_file")


def missing_summary(good: bytes) -> Damaged:
    """Cut after the data, with a footer that says that there is no summary: this is allowed."""
    at, length = middle(good, Opcode.DATA_END)
    end = at + 9 + length
    data = good[:end] + record(Opcode.FOOTER, bytes(20)) + MAGIC
    return _damaged(data, len(good), told=False)


def summary_cut_off(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.DATA_END)
    return _damaged(good[: at + 9 + length], len(good), "truncated_file")


def duplicate_statistics(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.STATISTICS)
    twice = insert(good, at, good[at : at + 9 + length])
    return _damaged(twice, len(twice), "summary_crc", "data_crc")


def duplicate_data_end(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.DATA_END)
    twice = insert(good, at, good[at : at + 9 + length])
    return _damaged(twice, len(good), "summary_crc", "data_crc")


def footer_in_the_middle(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(insert(good, at, record(Opcode.FOOTER, bytes(20))), at, "damaged_record")


def unknown_opcodes(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    strange = record(0x42, b"what is this") + record(0x90, b"private")
    return _damaged(insert(good, at, strange), at, "unknown_record")


def zero_length_records(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    empty = b"".join(record(opcode, b"") for opcode in (3, 4, 5, 7, 0x0C, 9))
    return _damaged(insert(good, at, empty), at, "damaged_record", "lost_place")


def garbage_between_records(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    noise = np.random.default_rng(1).bytes(5000)
    return _damaged(insert(good, at, b"\xee" * 9 + noise), at, "lost_place")


def zeros_between_records(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _damaged(insert(good, at, bytes(70_000)), at, "lost_place")


def block_of_zeros_over_a_chunk(good: bytes) -> Damaged:
    """A sector that never reached the disk, over the start of a chunk."""
    at, _ = middle(good, Opcode.CHUNK)
    lost = frames_in_chunk(good, at)
    return _damaged(put(good, at, bytes(512)), at, "lost_place", lost=lost)


def message_size_inside_a_chunk(good: bytes) -> Damaged:
    """A writer that lies: a whole chunk whose records do not fit it."""
    message = struct.pack("<HIQQ", 1, 0, START_NS, START_NS) + b"x"
    inside = record(Opcode.MESSAGE, message, length=10_000)
    at, _ = middle(good, Opcode.CHUNK)
    data = insert(good, at, chunk_record("", inside, len(inside)))
    return _damaged(data, at, "damaged_record")


def concatenated(good: bytes) -> Damaged:
    return _damaged(good + good, len(good), "another_recording", "repeated_chunk")


def bytes_after_the_end(good: bytes) -> Damaged:
    return _damaged(good + b"\x00" * 3000, len(good), "bytes_after_end")


def cut_in_a_chunk(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.CHUNK)
    return _cut(good, at + 9 + length // 2, at)


def cut_in_a_chunk_head(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _cut(good, at + 20, at)


def cut_in_a_record_head(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _cut(good, at + 5, at)


def cut_between_records(good: bytes) -> Damaged:
    at, _ = middle(good, Opcode.CHUNK)
    return _cut(good, at, at)


def cut_in_a_message_index(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.MESSAGE_INDEX)
    return _cut(good, at + length // 2, at)


def cut_in_the_attachment(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.ATTACHMENT)
    return _cut(good, at + length // 2, at)


def cut_in_the_summary(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.STATISTICS)
    return _cut(good, at + length // 2, at)


def cut_in_the_footer(good: bytes) -> Damaged:
    at, length = middle(good, Opcode.FOOTER)
    return _cut(good, at + length // 2, at)


def _cut(good: bytes, end: int, at: int) -> Damaged:
    later = [o for o, _ in offsets(good, Opcode.CHUNK) if o >= at]
    lost = sum(frames_in_chunk(good, o) for o in later)
    return _damaged(good[:end], len(good), "truncated_file", lost=lost, counted=False)


DAMAGES: dict[str, Callable[[bytes], Damaged]] = {
    make.__name__: make
    for make in (
        flipped_chunk_data,
        flipped_first_chunk,
        flipped_chunk_crc,
        wrong_uncompressed_size,
        uncompressed_size_of_terabytes,
        unknown_compression,
        chunk_length_too_large,
        chunk_length_too_small,
        chunk_length_over_the_next,
        zero_chunk_length,
        chunk_opcode_gone,
        chunk_opcode_unknown,
        chunk_opcode_another,
        chunk_opcode_a_message_s,
        chunk_repeated,
        first_chunk_and_a_byte_gone,
        flipped_message_index,
        message_index_length,
        flipped_attachment,
        flipped_attachment_length,
        flipped_metadata,
        metadata_map_too_large,
        flipped_header,
        flipped_data_end,
        flipped_summary_schema,
        flipped_statistics,
        flipped_chunk_index,
        flipped_footer,
        flipped_closing_magic,
        missing_footer,
        missing_closing_magic,
        missing_summary,
        summary_cut_off,
        duplicate_statistics,
        duplicate_data_end,
        footer_in_the_middle,
        unknown_opcodes,
        zero_length_records,
        garbage_between_records,
        zeros_between_records,
        block_of_zeros_over_a_chunk,
        message_size_inside_a_chunk,
        concatenated,
        bytes_after_the_end,
        cut_in_a_chunk,
        cut_in_a_chunk_head,
        cut_in_a_record_head,
        cut_between_records,
        cut_in_a_message_index,
        cut_in_the_attachment,
        cut_in_the_summary,
        cut_in_the_footer,
    )
}
