"""Named ways of damaging a recording, and how to find one's way in its bytes."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode
from mcap.writer import CompressionType, Writer

from pipeline.ingest.mcap_writer import RecordingWriter

MAGIC_BYTES = 8


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, offset and length of every record outside chunks."""
    at = MAGIC_BYTES
    while at + 9 <= len(data) - MAGIC_BYTES:
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield opcode, at, length
        at += 9 + length


def offsets(data: bytes, opcode: Opcode) -> list[tuple[int, int]]:
    return [(at, length) for op, at, length in records(data) if op == opcode]


def flipped(data: bytes, at: int, mask: int = 0xFF) -> bytes:
    return data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :]


class SmallChunks(RecordingWriter):
    """Writes chunks of a few messages, so that a little damage costs a little."""

    def __init__(
        self,
        path: Path,
        *,
        compression: CompressionType = CompressionType.NONE,
        chunked: bool = True,
    ) -> None:
        super().__init__(path)
        self._writer = Writer(
            self._stream,
            chunk_size=6_000,
            compression=compression,
            use_chunking=chunked,
            enable_data_crcs=True,
        )
        self._stream.seek(0)
        self._stream.truncate()
        self._writer.start(profile="", library="test")
