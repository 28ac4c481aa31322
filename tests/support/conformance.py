"""Files with every option of the MCAP specification on and off, written from the specification.

The features, and what is in the files, are those of the format's own conformance tests. The writer
shares nothing with the reader, nor with the `mcap` library: it can put bytes at the end of records,
which the specification allows to later versions and no library writes.
"""

from __future__ import annotations

import itertools
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
PADDING = b"\x01\x02\x03"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET = range(9, 15)
DATA_END = 15


@dataclass(frozen=True)
class Features:
    """Options of a writer."""

    chunks: bool
    message_index: bool
    chunk_index: bool
    statistics: bool
    summary_offsets: bool
    repeated_schemas: bool
    repeated_channels: bool
    attachment_index: bool
    metadata_index: bool
    crcs: bool
    padding: bool

    def __str__(self) -> str:
        return "-".join(f.name for f in fields(self) if getattr(self, f.name)) or "nothing"


def every_combination() -> Iterator[Features]:
    """Yield all that make sense: indexes of chunks need chunks."""
    for flags in itertools.product((False, True), repeat=len(fields(Features))):
        features = Features(*flags)
        if features.chunks or not (features.message_index or features.chunk_index):
            yield features


@dataclass(frozen=True)
class Content:
    """Contents of a file. Channel 2 has no schema."""

    messages: tuple[tuple[int, int, bytes], ...] = ()  # channel id, log time, data
    attachments: tuple[tuple[str, bytes], ...] = ()
    metadata: tuple[tuple[str, Mapping[str, str]], ...] = ()

    @property
    def channels(self) -> list[int]:
        return list(dict.fromkeys(channel for channel, _, _ in self.messages))


CONTENTS = {
    "no_data": Content(),
    "one_message": Content(messages=((1, 2, bytes(range(10))),)),
    "one_schemaless_message": Content(messages=((2, 2, b"\x01\x02"),)),
    "ten_messages": Content(
        messages=tuple((1 + index % 2, index, bytes([index] * index)) for index in range(10))
    ),
    "one_attachment": Content(attachments=(("my file", b"\x01\x02\x03"),)),
    "one_metadata": Content(metadata=(("my metadata", {"foo": "bar"}),)),
    "everything": Content(
        messages=tuple((1 + index % 3 % 2, 100 - index, b"x" * 40) for index in range(9)),
        attachments=(("a", b""), ("b", b"bb")),
        metadata=(("m", {}), ("m", {"a": "1", "b": "2"})),
    ),
}


def write(content: Content, features: Features, compression: str = "") -> bytes:
    """Return a file."""
    return _Writer(features, compression).file(content)


def _text(value: str) -> bytes:
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def _map(values: Mapping[str, str]) -> bytes:
    data = b"".join(_text(k) + _text(v) for k, v in values.items())
    return struct.pack("<I", len(data)) + data


class _Writer:
    def __init__(self, features: Features, compression: str) -> None:
        self.features = features
        self.compression = compression
        self.out = bytearray()
        self.chunk_indexes: list[bytes] = []
        self.indexes: dict[int, list[bytes]] = {ATTACHMENT_INDEX: [], METADATA_INDEX: []}

    def record(self, opcode: int, body: bytes) -> bytes:
        if self.features.padding and opcode != MESSAGE:  # a message's data ends where it ends
            body += PADDING
        return struct.pack("<BQ", opcode, len(body)) + body

    def crc(self, data: bytes) -> int:
        return zlib.crc32(data) if self.features.crcs else 0

    def schema(self) -> bytes:
        return self.record(
            SCHEMA,
            struct.pack("<H", 1) + _text("Example") + _text("c") + struct.pack("<I", 3) + b"def",
        )

    def channel(self, number: int) -> bytes:
        head = struct.pack("<HH", number, 1 if number == 1 else 0)
        return self.record(CHANNEL, head + _text(f"/{number}") + _text("a") + _map({"foo": "bar"}))

    def declared(self, channels: list[int]) -> list[bytes]:
        return [self.schema()] * (1 in channels) + [self.channel(c) for c in channels]

    def file(self, content: Content) -> bytes:
        self.out += MAGIC + self.record(HEADER, _text("") + _text("conformance"))
        if self.features.chunks and content.messages:
            half = (len(content.messages) + 1) // 2
            self.chunk(content, content.messages[:half], declare=True)
            if content.messages[half:]:
                self.chunk(content, content.messages[half:], declare=False)
        else:
            for data in self.declared(content.channels):
                self.out += data
            for number, (channel, time, data) in enumerate(content.messages):
                self.out += self.message(number, channel, time, data)
        self.extras(content)
        self.out += self.record(DATA_END, struct.pack("<I", self.crc(bytes(self.out))))
        self.summary(content)
        return bytes(self.out)

    def message(self, number: int, channel: int, time: int, data: bytes) -> bytes:
        return self.record(MESSAGE, struct.pack("<HIQQ", channel, number, time, time) + data)

    def chunk(
        self, content: Content, messages: tuple[tuple[int, int, bytes], ...], *, declare: bool
    ) -> None:
        inside, places = bytearray(), {}
        if declare:
            inside += b"".join(self.declared(content.channels))
        for number, (channel, time, data) in enumerate(messages):
            places.setdefault(channel, []).append((time, len(inside)))
            inside += self.message(number, channel, time, data)
        packed = bytes(inside)
        if self.compression:
            pack = {"lz4": lz4.frame.compress, "zstd": zstandard.compress}[self.compression]
            packed = pack(packed)
        times = [time for _, time, _ in messages]
        start, at = (min(times), max(times)), len(self.out)
        head = struct.pack("<QQQI", *start, len(inside), self.crc(bytes(inside)))
        chunk = self.record(
            CHUNK, head + _text(self.compression) + struct.pack("<Q", len(packed)) + packed
        )
        self.out += chunk
        index_at, indexes = len(self.out), {}
        if self.features.message_index:
            for channel, entries in places.items():
                indexes[channel] = len(self.out)
                body = b"".join(struct.pack("<QQ", *entry) for entry in entries)
                head = struct.pack("<HI", channel, len(body))
                self.out += self.record(MESSAGE_INDEX, head + body)
        offsets = b"".join(struct.pack("<HQ", *item) for item in indexes.items())
        self.chunk_indexes.append(
            struct.pack("<QQQQI", *start, at, len(chunk), len(offsets))
            + offsets
            + struct.pack("<Q", len(self.out) - index_at)
            + _text(self.compression)
            + struct.pack("<QQ", len(packed), len(inside))
        )

    def extras(self, content: Content) -> None:
        for name, data in content.attachments:
            body = struct.pack("<QQ", 2, 1) + _text(name) + _text("text/plain")
            body += struct.pack("<Q", len(data)) + data
            made = self.record(ATTACHMENT, body + struct.pack("<I", self.crc(body)))
            place = struct.pack("<QQQQQ", len(self.out), len(made), 2, 1, len(data))
            self.indexes[ATTACHMENT_INDEX].append(place + _text(name) + _text("text/plain"))
            self.out += made
        for name, values in content.metadata:
            made = self.record(METADATA, _text(name) + _map(values))
            place = struct.pack("<QQ", len(self.out), len(made))
            self.indexes[METADATA_INDEX].append(place + _text(name))
            self.out += made

    def summary(self, content: Content) -> None:
        features, start = self.features, len(self.out)
        groups: list[tuple[int, list[bytes]]] = []
        if features.repeated_schemas and 1 in content.channels:
            groups.append((SCHEMA, [self.schema()]))
        if features.repeated_channels:
            groups.append((CHANNEL, [self.channel(c) for c in content.channels]))
        if features.statistics:
            groups.append((STATISTICS, [self.statistics(content)]))
        for wanted, opcode, bodies in (
            (features.chunk_index, CHUNK_INDEX, self.chunk_indexes),
            (features.attachment_index, ATTACHMENT_INDEX, self.indexes[ATTACHMENT_INDEX]),
            (features.metadata_index, METADATA_INDEX, self.indexes[METADATA_INDEX]),
        ):
            if wanted:
                groups.append((opcode, [self.record(opcode, body) for body in bodies]))
        places = []
        for opcode, made in groups:
            if made:
                places.append((opcode, len(self.out), sum(map(len, made))))
                self.out += b"".join(made)
        offsets_at = 0
        if features.summary_offsets and places:
            offsets_at = len(self.out)
            for place in places:
                self.out += self.record(SUMMARY_OFFSET, struct.pack("<BQQ", *place))
        body = struct.pack("<QQ", start if places else 0, offsets_at)
        padded = len(PADDING) if features.padding else 0
        head = struct.pack("<BQ", FOOTER, len(body) + 4 + padded)
        crc = self.crc(bytes(self.out[start:]) + head + body)
        self.out += self.record(FOOTER, body + struct.pack("<I", crc)) + MAGIC

    def statistics(self, content: Content) -> bytes:
        times = [time for _, time, _ in content.messages] or [0]
        counts = {c: sum(m[0] == c for m in content.messages) for c in content.channels}
        body = struct.pack(
            "<QHIIIIQQI",
            len(content.messages),
            int(1 in counts),
            len(counts),
            len(content.attachments),
            len(content.metadata),
            len(self.chunk_indexes),
            min(times),
            max(times),
            10 * len(counts),
        )
        return self.record(
            STATISTICS, body + b"".join(struct.pack("<HQ", *item) for item in counts.items())
        )
