"""From the bytes of an MCAP file to its messages, in file order, past whatever is damaged.

The `mcap` library's stream reader stops at the first damaged record and does not tell where it
was; evidence must not stop there. So the framing (one byte opcode, eight bytes length) is walked
here, bounded by the size of the file, and the library parses what is inside. Every CRC that a file
has is checked. A chunk that fails costs that chunk.

Source: the MCAP format specification, version 0.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, MessageIndex, Metadata, Schema

from pipeline.config import Limits
from pipeline.errors import NotARecording, Where
from pipeline.records import Diagnostic, Severity

MAGIC = b"\x89MCAP0\r\n"
_FRAMING = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel id, sequence, log time, publish time
_FOOTER = struct.Struct("<QQI")  # summary start, summary offset start, summary CRC

Note = Callable[[Diagnostic], None]
R = TypeVar("R")


class ChannelInfo(NamedTuple):
    """A channel and its schema, as far as the file has one."""

    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes = b""
    metadata: tuple[tuple[str, str], ...] = ()


class RawMessage(NamedTuple):
    """One message, not yet decoded. `byte_offset` is that of its chunk, if it is in one."""

    channel_id: int
    channel: ChannelInfo
    log_time_ns: int
    data: bytes
    byte_offset: int
    publish_time_ns: int = 0
    sequence: int = 0


class _Damage(Exception):
    """A record that cannot be read; the text says why."""


class McapFile:
    """One walk over the records of a file; afterwards the hash of all its bytes is known."""

    def __init__(self, path: Path, limits: Limits, note: Note) -> None:
        """Open nothing yet; `note` receives a diagnostic for whatever is damaged."""
        self.path = path
        self.size_bytes = path.stat().st_size
        self.metadata: list[Metadata] = []
        self.channels: dict[int, ChannelInfo] = {}
        self.message_counts: dict[int, int] = {}
        self._limits = limits
        self._note = note
        self._schemas: dict[int, Schema] = {}
        self._sha256 = hashlib.sha256()
        self._crc = 0
        self._bad_chunk: Chunk | None = None
        self._bad_chunk_offset = 0

    @property
    def content_sha256(self) -> str:
        """SHA-256 of the whole file; valid after `messages` is exhausted."""
        return self._sha256.hexdigest()

    def messages(self) -> Iterator[RawMessage]:
        """Yield every message that can be read.

        Raises:
            NotARecording: the file is empty, or is no MCAP.
        """
        where = Where(self.path)
        with self.path.open("rb", buffering=1 << 20) as stream:
            magic = self._read(stream, len(MAGIC))
            if not magic:
                raise NotARecording("the file is empty", where=where)
            if magic != MAGIC:
                raise NotARecording(
                    f"not an MCAP file (it starts with {magic[:8]!r})",
                    where=where,
                    remedy="`stadimeter import` makes a recording of a video",
                )
            yield from self._walk(stream)
            while self._read(stream, 1 << 20):
                pass  # the hash is of the whole file, read or not

    def _read(self, stream: BinaryIO, length: int) -> bytes:
        data = stream.read(length)
        self._sha256.update(data)
        return data

    def _walk(self, stream: BinaryIO) -> Iterator[RawMessage]:
        self._crc = zlib.crc32(MAGIC)
        while True:
            offset = stream.tell()
            head = self._read(stream, _FRAMING.size)
            if len(head) < _FRAMING.size:
                self._truncated(offset, "the file ends without a footer")
                return
            opcode, length = _FRAMING.unpack(head)
            rest = self.size_bytes - stream.tell()
            if opcode == 0 or length > min(rest, self._limits.record_bytes):
                if length > rest and opcode in set(Opcode):
                    self._truncated(
                        offset,
                        f"a {Opcode(opcode).name} record claims {length:,} bytes, {rest:,} are left",
                    )
                else:
                    self._truncated(
                        offset, f"no record starts here (opcode {opcode}, length {length:,})"
                    )
                resume = self._next_chunk_after(offset)
                if resume is None:
                    return
                self._skip_to(stream, resume)
                continue
            body = self._read(stream, length)
            if len(body) < length:
                self._truncated(offset, "the file shrank while it was read")
                return
            if opcode == Opcode.FOOTER:
                return
            if opcode == Opcode.DATA_END:
                self._check_data_end(body, offset)
            else:
                self._crc = zlib.crc32(body, zlib.crc32(head, self._crc))
            try:
                yield from self._record(opcode, body, offset)
            except (_Damage, McapError, ValueError, struct.error, UnicodeDecodeError) as error:
                self._damaged_record(opcode, offset, error)

    def _record(self, opcode: int, body: bytes, offset: int) -> Iterator[RawMessage]:
        if opcode == Opcode.CHUNK:
            yield from self._chunk(body, offset)
        elif opcode == Opcode.MESSAGE:
            yield from self._message(body, offset)
        elif opcode == Opcode.SCHEMA:
            self._add_schema(_parse(Schema, body))
        elif opcode == Opcode.CHANNEL:
            self._add_channel(_parse(Channel, body), offset)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._count_lost(_parse(MessageIndex, body))
        elif opcode == Opcode.METADATA:
            self.metadata.append(_parse(Metadata, body))

    def _add_schema(self, schema: Schema) -> None:
        self._schemas[schema.id] = schema

    def _add_channel(self, channel: Channel, offset: int) -> None:
        if channel.id not in self.channels and len(self.channels) >= self._limits.channels:
            raise _Damage(f"more than {self._limits.channels} channels")
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id != 0:
            self._note(
                Diagnostic(
                    Severity.WARNING,
                    "missing_schema",
                    f"the channel names schema {channel.schema_id}, which the file does not hold",
                    topic=channel.topic,
                    byte_offset=offset,
                )
            )
        self.channels[channel.id] = ChannelInfo(
            channel.topic,
            channel.message_encoding,
            schema.name if schema else "",
            schema.encoding if schema else "",
            schema.data if schema else b"",
            tuple(channel.metadata.items()),
        )

    def _message(self, body: bytes, offset: int) -> Iterator[RawMessage]:
        if len(body) < _MESSAGE_HEAD.size:
            raise _Damage(f"a message of {len(body)} bytes")
        channel_id, sequence, log_time_ns, publish_time_ns = _MESSAGE_HEAD.unpack_from(body)
        channel = self.channels.get(channel_id)
        if channel is None:
            raise _Damage(f"a message of channel {channel_id}, which the file does not declare")
        self.message_counts[channel_id] = self.message_counts.get(channel_id, 0) + 1
        data = body[_MESSAGE_HEAD.size :]
        yield RawMessage(channel_id, channel, log_time_ns, data, offset, publish_time_ns, sequence)

    def _chunk(self, body: bytes, offset: int) -> Iterator[RawMessage]:
        chunk = _parse(Chunk, body)
        try:
            data = self._decompress(chunk)
        except (_Damage, RuntimeError, zstandard.ZstdError) as error:
            self._bad_chunk, self._bad_chunk_offset = chunk, offset
            self._note(
                Diagnostic(
                    Severity.ERROR,
                    "damaged_chunk",
                    f"a chunk of {len(body):,} bytes was left out: {error}",
                    byte_offset=offset,
                    log_time_ns=chunk.message_start_time,
                    end_time_ns=chunk.message_end_time,
                )
            )
            return
        self._bad_chunk = None
        position = 0
        while position + _FRAMING.size <= len(data):
            opcode, length = _FRAMING.unpack_from(data, position)
            position += _FRAMING.size
            if length > len(data) - position:
                raise _Damage(f"a record in a chunk claims {length:,} bytes")
            yield from self._record_in_chunk(opcode, data[position : position + length], offset)
            position += length

    def _record_in_chunk(self, opcode: int, body: bytes, offset: int) -> Iterator[RawMessage]:
        if opcode in (Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                yield from self._record(opcode, body, offset)
            except (_Damage, McapError, ValueError, struct.error, UnicodeDecodeError) as error:
                self._damaged_record(opcode, offset, error)

    def _decompress(self, chunk: Chunk) -> bytes:
        size = chunk.uncompressed_size
        if size > self._limits.chunk_bytes:
            raise _Damage(f"it claims {size:,} bytes, the limit is {self._limits.chunk_bytes:,}")
        if chunk.compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
        elif chunk.compression == "zstd":
            if zstandard.frame_content_size(chunk.data) > size:  # else it is allocated at once
                raise _Damage("it expands to more than it claims")
            data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size + 1)
        elif chunk.compression == "":
            data = chunk.data
        else:
            raise _Damage(f"compression {chunk.compression!r} is not known")
        if len(data) != size:
            raise _Damage(f"it holds {len(data):,} bytes where it claims {size:,}")
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise _Damage("its CRC does not fit its content")
        return data

    def _count_lost(self, index: MessageIndex) -> None:
        """Say how many messages of which topic a damaged chunk took with it."""
        chunk = self._bad_chunk
        if chunk is None or not index.records:
            return
        channel = self.channels.get(index.channel_id)
        self._note(
            Diagnostic(
                Severity.ERROR,
                "lost_messages",
                "messages were lost with a damaged chunk"
                + (f" ({channel.schema_name})" if channel else ""),
                topic=channel.topic if channel else None,
                byte_offset=self._bad_chunk_offset,
                log_time_ns=chunk.message_start_time,
                end_time_ns=chunk.message_end_time,
                count=len(index.records),
            )
        )

    def _check_data_end(self, body: bytes, offset: int) -> None:
        expected = _parse(DataEnd, body).data_section_crc
        if expected and expected != self._crc:
            self._note(
                Diagnostic(
                    Severity.ERROR,
                    "data_crc",
                    "the CRC of the data section does not fit: bytes outside the chunks' own CRCs, "
                    "or inside a chunk reported above, were changed",
                    byte_offset=offset,
                )
            )

    def _truncated(self, offset: int, problem: str) -> None:
        self._note(
            Diagnostic(
                Severity.ERROR,
                "truncated_file",
                f"{problem}; every whole record before it was kept",
                byte_offset=offset,
            )
        )

    def _damaged_record(self, opcode: int, offset: int, error: Exception) -> None:
        name = Opcode(opcode).name if opcode in set(Opcode) else f"opcode {opcode}"
        self._note(
            Diagnostic(
                Severity.ERROR,
                "damaged_record",
                f"a {name} record was left out: {error}",
                byte_offset=offset,
            )
        )

    def _next_chunk_after(self, offset: int) -> int | None:
        """Return where the next chunk starts, by the summary at the end of the file."""
        try:
            starts = [i.chunk_start_offset for i in self._chunk_indexes()]
        except (McapError, ValueError, struct.error, OSError):
            return None
        return min((s for s in starts if s >= offset + _FRAMING.size), default=None)

    def _chunk_indexes(self) -> Iterator[ChunkIndex]:
        tail = _FRAMING.size + _FOOTER.size + len(MAGIC)
        with self.path.open("rb") as stream:
            stream.seek(-tail, 2)
            end = stream.read(tail)
            opcode, _ = _FRAMING.unpack_from(end)
            if end[-len(MAGIC) :] != MAGIC or opcode != Opcode.FOOTER:
                return
            start, _, _ = _FOOTER.unpack_from(end, _FRAMING.size)
            length = self.size_bytes - tail - start
            if start == 0 or not 0 < length <= self._limits.record_bytes:
                return
            stream.seek(start)
            summary = stream.read(length)
        position = 0
        while position + _FRAMING.size <= len(summary):
            opcode, length = _FRAMING.unpack_from(summary, position)
            position += _FRAMING.size
            if opcode == Opcode.CHUNK_INDEX:
                yield _parse(ChunkIndex, summary[position : position + length])
            position += length

    def _skip_to(self, stream: BinaryIO, offset: int) -> None:
        """Move on to `offset`, hashing what is passed over."""
        missing = offset - stream.tell()
        while missing > 0:
            missing -= len(self._read(stream, min(missing, 1 << 20)))


def _parse(kind: type[R], body: bytes) -> R:
    record: R = kind.read(ReadDataStream(BytesIO(body)))  # type: ignore[attr-defined]
    return record
