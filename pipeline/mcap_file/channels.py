"""The channels of a recording and their schemas; from the summary where their own are damaged."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.core.records import Severity
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.records import (
    FRAMING,
    MAGIC,
    Malformed,
    SchemaRecord,
    read_channel,
    read_footer,
    read_schema,
    read_statistics,
    read_time_range,
)

Tell = Callable[[Severity, str, str, int | None, str | None], None]
_FOOTER_BODY = 20
_FOOTER_REACH = 4096  # a later version of the format may have made it longer
_IDS = 1 << 16  # of one recording


class ChannelInfo(NamedTuple):
    """A channel and its schema, as far as the file has one."""

    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes = b""
    metadata: tuple[tuple[str, str], ...] = ()


class Topics:
    """Channels by id. In a file of several recordings each has its own range of ids."""

    def __init__(self, limits: Limits, tell: Tell) -> None:
        """Open nothing; `source` is set when the file is read."""
        self.source: ForwardFile | None = None
        self.channels: dict[int, ChannelInfo] = {}
        self.first_id = 0
        self._limits = limits
        self._tell = tell
        self._schemas: dict[int, SchemaRecord] = {}
        self._schema_bytes = 0
        self._unread_summary = True

    def knows(self, channel_id: int) -> bool:
        """Return whether this recording declares a channel, in its data or in its summary."""
        number = channel_id + self.first_id
        return number in self.channels or self.from_summary(number, None) is not None

    def begin_another(self) -> None:
        """Start with another recording in the same file."""
        self.first_id += _IDS
        self._schemas = {}

    def add_schema(self, body: bytes | memoryview) -> None:
        """Take a schema record.

        Raises:
            Malformed: it cannot be read, or is too large.
        """
        schema = read_schema(body, self._limits.name_bytes, self._limits.schema_bytes)
        if self._schemas.get(schema.id) == schema:
            return
        self._schema_bytes += len(schema.data)
        if self._schema_bytes > self._limits.all_schema_bytes:
            raise Malformed(f"schemas of more than {self._limits.all_schema_bytes:,} bytes in all")
        self._schemas[schema.id] = schema

    def add_channel(self, body: bytes | memoryview, offset: int | None) -> None:
        """Take a channel record.

        Raises:
            Malformed: it cannot be read, or there are too many.
        """
        channel = read_channel(body, self._limits.name_bytes, self._limits.metadata_bytes)
        channel_id = channel.id + self.first_id
        if channel_id not in self.channels and len(self.channels) >= self._limits.channels:
            raise Malformed(f"more than {self._limits.channels:,} channels")
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id != 0:
            self._tell(
                Severity.WARNING,
                "missing_schema",
                f"the channel names schema {channel.schema_id}, which the file does not hold",
                offset,
                channel.topic,
            )
        info = ChannelInfo(
            channel.topic,
            channel.message_encoding,
            schema.name if schema else "",
            schema.encoding if schema else "",
            schema.data if schema else b"",
            tuple(channel.metadata.items()),
        )
        before = self.channels.setdefault(channel_id, info)
        if before != info:
            self._tell(
                Severity.WARNING,
                "redefined_channel",
                f"the channel was {before.topic!r} before",
                offset,
                channel.topic,
            )
            self.channels[channel_id] = info

    def from_summary(self, channel_id: int, offset: int | None) -> ChannelInfo | None:
        """Return a channel that only the summary at the end of the file declares."""
        if self._unread_summary and self.source is not None:
            self._unread_summary = False
            for opcode, body in _summary_records(self.source, self._limits.record_bytes):
                try:
                    if opcode == Opcode.SCHEMA:
                        self._add_missing_schema(body)
                    elif opcode == Opcode.CHANNEL:
                        self._add_missing_channel(body, offset)
                except Malformed:
                    continue  # it is reported when the walk comes to it
        return self.channels.get(channel_id)

    def _add_missing_schema(self, body: bytes | memoryview) -> None:
        if int.from_bytes(body[:2], "little") not in self._schemas:
            self.add_schema(body)

    def _add_missing_channel(self, body: bytes | memoryview, offset: int | None) -> None:
        if int.from_bytes(body[:2], "little") + self.first_id not in self.channels:
            self.add_channel(body, offset)


class Statistics(NamedTuple):
    """Statistics of the whole file, from the summary at its end."""

    channels: dict[int, ChannelInfo]
    message_counts: dict[int, int]
    start_ns: int
    end_ns: int


def statistics_of(path: Path, limits: Limits) -> Statistics | None:
    """Return what the summary says without reading the rest; None if it is not there or damaged."""
    topics = Topics(limits, lambda *_: None)
    with ForwardFile(path) as source:
        topics.source = source
        topics.from_summary(-1, None)
        bodies = [
            b for o, b in _summary_records(source, limits.record_bytes) if o == Opcode.STATISTICS
        ]
    if not bodies:
        return None
    try:
        counts = read_statistics(bodies[0])
        start_ns, end_ns = read_time_range(bodies[0])
    except Malformed:
        return None
    return Statistics(topics.channels, counts, start_ns, end_ns)


def _summary_records(source: ForwardFile, limit: int) -> Iterator[tuple[int, bytes]]:
    """Yield schemas, channels and statistics of the summary, if it is there and its CRC fits."""
    found = _footer(source)
    if found is None:
        return
    end, head = found
    footer = read_footer(head[FRAMING.size :])
    start, size = footer.summary_start, end - footer.summary_start
    if start == 0 or not 0 < size <= limit:
        return
    summary = source.peek(start, size)
    stated = zlib.crc32(head[: FRAMING.size + 16], zlib.crc32(summary))
    if footer.summary_crc and stated != footer.summary_crc:
        return
    position = 0
    while position + FRAMING.size <= size:
        opcode, length = FRAMING.unpack_from(summary, position)
        position += FRAMING.size
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
            yield opcode, summary[position : position + length]
        position += length


def _footer(source: ForwardFile) -> tuple[int, bytes] | None:
    """Return where the footer at the end of the file starts, and its bytes."""
    start = max(source.size - _FOOTER_REACH, 0)
    tail = source.peek(start, _FOOTER_REACH).removesuffix(MAGIC)
    at = len(tail)
    while (at := tail.rfind(bytes([Opcode.FOOTER]), 0, at)) >= 0:
        body = len(tail) - at - FRAMING.size
        if body >= _FOOTER_BODY and FRAMING.unpack_from(tail, at)[1] == body:
            return start + at, tail[at:]
    return None
