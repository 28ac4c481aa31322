"""Channels of a recording and their schemas; where their own records are damaged, by others.

The same declaration may stand in several places: before the messages, in later chunks, in the summary.
One that a CRC covers is believed before one that none covers, and any is better than none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from pipeline.core.config import Limits
from pipeline.core.records import Severity
from pipeline.mcap_file.records import (
    ChannelRecord,
    Malformed,
    SchemaRecord,
    read_channel,
    read_schema,
)

Tell = Callable[[Severity, str, str, int | None, str | None], None]
Declarations = Iterable[tuple[int, bytes]]  # opcode and fields of schema and channel records
_IDS = 1 << 16  # of one recording


class ChannelInfo(NamedTuple):
    """A channel and its schema, as far as the file has one."""

    topic: str
    message_encoding: str
    schema_name: str
    schema_encoding: str
    schema_data: bytes = b""
    metadata: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(
        cls, channel: ChannelRecord | Channel, schema: SchemaRecord | Schema | None
    ) -> ChannelInfo:
        """Return a channel as a file declares it, with its schema if there is one."""
        return cls(
            channel.topic,
            channel.message_encoding,
            schema.name if schema else "",
            schema.encoding if schema else "",
            schema.data if schema else b"",
            tuple(channel.metadata.items()),
        )


class Topics:
    """Channels by id. In a file of several recordings each has its own range of ids.

    `elsewhere` is set where a file is read: it gives places in which declarations may survive, the
    most trustworthy first, each as a function that reads them. Each is read when it is needed.
    """

    def __init__(self, limits: Limits, tell: Tell) -> None:
        """Begin without any."""
        self.channels: dict[int, ChannelInfo] = {}
        self.first_id = 0
        self.before: dict[int, ChannelInfo] = {}  # of channels that were declared anew: the first
        self.incomplete: set[int] = set()  # channels whose schema is nowhere
        self.elsewhere: Callable[[], Iterator[Callable[[], Declarations]]] = lambda: iter(())
        self._limits = limits
        self._tell = tell
        self._schemas: dict[int, SchemaRecord] = {}
        self._schema_bytes = 0
        self._places: Iterator[Callable[[], Declarations]] | None = None
        self._proven: dict[int, SchemaRecord | ChannelRecord] | None = None
        self._prove: Callable[[], Declarations] = tuple

    def believe(self, prove: Callable[[], Declarations]) -> None:
        """Set how to read declarations that a CRC covers, where a record's own place has none."""
        self._prove, self._proven = prove, None

    def knows(self, channel_id: int) -> bool:
        """Return whether this recording declared a channel so far, or does in its summary."""
        return channel_id + self.first_id in self.channels or channel_id in self._proven_records()

    def begin_another(self) -> None:
        """Start with another recording in the same file."""
        self.first_id += _IDS
        self._schemas = {}
        self._places = None
        self._proven = None

    def find(self, channel_id: int) -> ChannelInfo | None:
        """Return a channel; one whose own record was lost by another that survives."""
        if channel_id not in self.channels:
            self._look_elsewhere(lambda: channel_id in self.channels)
        return self.channels.get(channel_id)

    def add_schema(self, body: bytes | memoryview, *, proven: bool = True) -> None:
        """Take a schema record; `proven`: a CRC covers it.

        Raises:
            Malformed: it cannot be read, or is too large.
        """
        schema = self._schema(body)
        if not proven:
            stated = self._proven_records().get(_IDS + schema.id)
            schema = stated if isinstance(stated, SchemaRecord) else schema
        if self._schemas.get(schema.id) == schema:
            return
        self._schema_bytes += len(schema.data)
        if self._schema_bytes > self._limits.all_schema_bytes:
            raise Malformed(f"schemas of more than {self._limits.all_schema_bytes:,} bytes in all")
        self._schemas[schema.id] = schema

    def add_channel(
        self, body: bytes | memoryview, offset: int | None, *, proven: bool = True
    ) -> None:
        """Take a channel record; `proven`: a CRC covers it.

        Raises:
            Malformed: it cannot be read, or there are too many.
        """
        channel = self._channel(body)
        if not proven:
            stated = self._proven_records().get(channel.id)
            channel = stated if isinstance(stated, ChannelRecord) else channel
        channel_id = channel.id + self.first_id
        if channel_id not in self.channels and len(self.channels) >= self._limits.channels:
            raise Malformed(f"more than {self._limits.channels:,} channels")
        info = self._with_schema(channel, channel_id, offset)
        before = self.channels.setdefault(channel_id, info)
        if before != info:
            self.before.setdefault(channel_id, before)
            self._tell(
                Severity.WARNING,
                "redefined_channel",
                f"the channel was {before.topic!r} before",
                offset,
                channel.topic,
            )
            self.channels[channel_id] = info

    def add_declarations(self, records: Declarations, offset: int | None) -> None:
        """Take schemas and channels that are missing; what is malformed is told in its own place."""
        for opcode, body in records:
            try:
                number = int.from_bytes(body[:2], "little")
                if opcode == Opcode.SCHEMA and number not in self._schemas:
                    self.add_schema(body)
                elif opcode == Opcode.CHANNEL and number + self.first_id not in self.channels:
                    self.add_channel(body, offset)
            except Malformed:
                continue

    def _with_schema(
        self, channel: ChannelRecord, channel_id: int, offset: int | None
    ) -> ChannelInfo:
        wanted = channel.schema_id
        if wanted and wanted not in self._schemas:
            self._look_elsewhere(lambda: wanted in self._schemas)
        schema = self._schemas.get(wanted)
        self.incomplete.discard(channel_id)
        if schema is None and wanted != 0:
            self.incomplete.add(channel_id)
            self._tell(
                Severity.WARNING,
                "missing_schema",
                f"the channel names schema {wanted}, which the file does not hold",
                offset,
                channel.topic,
            )
        return ChannelInfo.of(channel, schema)

    def _look_elsewhere(self, found: Callable[[], bool]) -> None:
        """Read one place after the other until what is missing is found."""
        if self._places is None:
            self._places = self.elsewhere()
        while not found():
            place = next(self._places, None)
            if place is None:
                return
            self.add_declarations(place(), None)

    def _proven_records(self) -> dict[int, SchemaRecord | ChannelRecord]:
        """Return channels by id, and schemas by id plus 65,536, that a CRC covers."""
        if self._proven is None:
            self._proven = {}
            for opcode, body in self._prove():
                try:
                    if opcode == Opcode.SCHEMA:
                        schema = self._schema(body)
                        self._proven[_IDS + schema.id] = schema
                    elif opcode == Opcode.CHANNEL:
                        channel = self._channel(body)
                        self._proven[channel.id] = channel
                except Malformed:
                    continue
        return self._proven

    def _schema(self, body: bytes | memoryview) -> SchemaRecord:
        return read_schema(body, self._limits.name_bytes, self._limits.schema_bytes)

    def _channel(self, body: bytes | memoryview) -> ChannelRecord:
        return read_channel(body, self._limits.name_bytes, self._limits.metadata_bytes)
