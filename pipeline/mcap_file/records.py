"""Records of an MCAP file as bytes: their fields, and the length that those fields add up to.

Everything here is bounded by the bytes it is given, so a length that lies is found out before
memory is taken for it.

Source: the MCAP format specification, version 0.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
FRAMING = struct.Struct("<BQ")  # opcode, length
MESSAGE_HEAD = struct.Struct("<HIQQ")  # channel id, sequence, log time, publish time
KNOWN_OPCODES = frozenset(int(opcode) for opcode in Opcode)
FIRST_PRIVATE_OPCODE = 0x80
_CHUNK_HEAD = struct.Struct("<QQQII")  # times, size, CRC, length of the compression's name
_FRAME_MAGIC = {"lz4": b"\x04\x22\x4d\x18", "zstd": b"\x28\xb5\x2f\xfd"}

Peek = Callable[[int, int], bytes]  # offset, count -> at most so many bytes

# What stands in a record: a number is so many bytes; "s" a length of four bytes and so many
# more (a text, a map, an array), "l" the same with a length of eight.
_LAYOUTS: dict[int, tuple[int | str, ...]] = {
    Opcode.HEADER: ("s", "s"),
    Opcode.FOOTER: (20,),
    Opcode.SCHEMA: (2, "s", "s", "s"),
    Opcode.CHANNEL: (4, "s", "s", "s"),
    Opcode.CHUNK: (28, "s", "l"),
    Opcode.MESSAGE_INDEX: (2, "s"),
    Opcode.CHUNK_INDEX: (32, "s", 8, "s", 16),
    Opcode.ATTACHMENT: (16, "s", "s", "l", 4),
    Opcode.METADATA: ("s", "s"),
    Opcode.DATA_END: (4,),
    Opcode.STATISTICS: (42, "s"),
    Opcode.METADATA_INDEX: (16, "s"),
    Opcode.ATTACHMENT_INDEX: (40, "s", "s"),
    Opcode.SUMMARY_OFFSET: (17,),
}

# What is brought in the place of an MCAP, by its first bytes, and what helps.
_OTHERS = {
    b"\x28\xb5\x2f\xfd": "It is compressed as a whole: unpack it with zstd -d",
    b"\x1f\x8b": "It is compressed as a whole: unpack it with gunzip",
    b"#ROSBAG": "It is a bag of ROS 1: `mcap convert` of the MCAP tools makes an MCAP of it",
    b"SQLite f": "It is a bag of ROS 2 in SQLite: `ros2 bag convert` makes an MCAP of it",
}


class Malformed(ValueError):
    """A record that cannot be read; the text says why."""


class SchemaRecord(NamedTuple):
    """A schema: the format of the messages of a channel."""

    id: int
    name: str
    encoding: str
    data: bytes


class ChannelRecord(NamedTuple):
    """A topic and how its messages are encoded."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: dict[str, str]


class ChunkRecord(NamedTuple):
    """Records packed together; `data` is a view of the record's own bytes."""

    message_start_time: int
    message_end_time: int
    uncompressed_size: int
    uncompressed_crc: int
    compression: str
    data: memoryview


class MetadataRecord(NamedTuple):
    """Names and values that belong to the whole file."""

    name: str
    metadata: dict[str, str]


class Footer(NamedTuple):
    """The footer: the offset at which the summary starts, and its CRC."""

    summary_start: int
    summary_offset_start: int
    summary_crc: int


class Fields:
    """Takes one field after the other from a record."""

    def __init__(self, body: bytes | memoryview) -> None:
        self._body = memoryview(body)
        self.position = 0

    def numbers(self, layout: str) -> tuple[int, ...]:
        """Return little-endian integers by their `struct` letters."""
        return struct.unpack("<" + layout, self.take(struct.calcsize("<" + layout)))

    def take(self, count: int) -> memoryview:
        """Return the next bytes.

        Raises:
            Malformed: there are not so many.
        """
        start, left = self.position, len(self._body) - self.position
        if count > left:
            raise Malformed(f"a field claims {count:,} bytes, {left:,} are left in the record")
        self.position += count
        return self._body[start : self.position]

    def text(self, limit: int) -> str:
        """Return a text; bytes that are no UTF-8 are kept visible, so that names stay apart."""
        (count,) = self.numbers("I")
        if count > limit:
            raise Malformed(f"a name of {count:,} bytes, the limit is {limit:,}")
        return str(self.take(count), "utf-8", "backslashreplace")

    def text_map(self, limit: int) -> dict[str, str]:
        """Return a map of texts, whose size is bounded as a whole."""
        (count,) = self.numbers("I")
        if count > limit:
            raise Malformed(f"metadata of {count:,} bytes, the limit is {limit:,}")
        inside = Fields(self.take(count))
        pairs: dict[str, str] = {}
        while inside.position < count:
            key = inside.text(limit)
            pairs[key] = inside.text(limit)
        return pairs


def read_schema(body: bytes | memoryview, name_bytes: int, schema_bytes: int) -> SchemaRecord:
    """Return a schema.

    Raises:
        Malformed: its fields do not fit, or are larger than is allowed.
    """
    fields = Fields(body)
    (number,) = fields.numbers("H")
    name, encoding = fields.text(name_bytes), fields.text(name_bytes)
    (count,) = fields.numbers("I")
    if count > schema_bytes:
        raise Malformed(f"schema {name!r} of {count:,} bytes, the limit is {schema_bytes:,}")
    return SchemaRecord(number, name, encoding, bytes(fields.take(count)))


def read_channel(body: bytes | memoryview, name_bytes: int, metadata_bytes: int) -> ChannelRecord:
    """Return a channel.

    Raises:
        Malformed: its fields do not fit, or are larger than is allowed.
    """
    fields = Fields(body)
    number, schema_id = fields.numbers("HH")
    topic, encoding = fields.text(name_bytes), fields.text(name_bytes)
    return ChannelRecord(number, schema_id, topic, encoding, fields.text_map(metadata_bytes))


def read_chunk(body: bytes | memoryview) -> ChunkRecord:
    """Return a chunk, still compressed.

    Raises:
        Malformed: its fields do not fit.
    """
    fields = Fields(body)
    start, end, size, crc = fields.numbers("QQQI")
    compression = fields.text(64)
    (count,) = fields.numbers("Q")
    return ChunkRecord(start, end, size, crc, compression, fields.take(count))


def read_cut_chunk(body: bytes | memoryview) -> ChunkRecord:
    """Return a chunk of which the end is missing.

    Raises:
        Malformed: not even its head is there.
    """
    fields = Fields(body)
    start, end, size, crc = fields.numbers("QQQI")
    compression = fields.text(64)
    fields.numbers("Q")
    rest = fields.take(len(body) - fields.position)
    return ChunkRecord(start, end, size, crc, compression, rest)


def chunk_readings(body: bytes | memoryview) -> Iterator[ChunkRecord]:
    """Yield what a chunk may be that has a CRC, whatever it says of its sizes and compression."""
    view = memoryview(body)
    if len(view) < _CHUNK_HEAD.size:
        return
    start, end, size, crc, _ = _CHUNK_HEAD.unpack_from(view)
    if crc == 0:
        return
    for compression in ("", "lz4", "zstd"):
        data = view[_CHUNK_HEAD.size + len(compression) + 8 :]
        if not compression or bytes(data[:4]) == _FRAME_MAGIC[compression]:
            yield ChunkRecord(start, end, size, crc, compression, data)


def read_metadata(body: bytes | memoryview, name_bytes: int, metadata_bytes: int) -> MetadataRecord:
    """Return a metadata record.

    Raises:
        Malformed: its fields do not fit, or are larger than is allowed.
    """
    fields = Fields(body)
    return MetadataRecord(fields.text(name_bytes), fields.text_map(metadata_bytes))


def read_message_index(body: bytes | memoryview) -> tuple[int, int]:
    """Return a channel's id, and how many messages of it the chunk before holds."""
    fields = Fields(body)
    channel_id, size = fields.numbers("HI")
    return channel_id, len(fields.take(size)) // 16


def read_statistics(body: bytes | memoryview) -> dict[int, int]:
    """Return how many messages each channel has, by its id."""
    fields = Fields(body)
    fields.take(42)
    (size,) = fields.numbers("I")
    pairs = fields.take(size - size % 10)
    return dict(struct.iter_unpack("<HQ", pairs))


def read_data_crc(body: bytes | memoryview) -> int:
    """Return the CRC of the data section; 0 is none."""
    (crc,) = Fields(body).numbers("I")
    return crc


def read_time_range(body: bytes | memoryview) -> tuple[int, int]:
    """Return the first and the last log time of a file, by its statistics."""
    fields = Fields(body)
    fields.take(26)
    start_ns, end_ns = fields.numbers("QQ")
    return start_ns, end_ns


def read_footer(body: bytes | memoryview) -> Footer:
    """Return the footer."""
    return Footer(*Fields(body).numbers("QQI"))


def content_length(opcode: int, offset: int, peek: Peek) -> int | None:
    """Return how long the fields of the record at `offset` say that they are; None if unknown.

    Messages and records of unknown opcodes end where their length says, and nowhere else.
    """
    layout = _LAYOUTS.get(opcode)
    if layout is None:
        return None
    start = at = offset + FRAMING.size
    for field in layout:
        if isinstance(field, int):
            at += field
            continue
        width = 4 if field == "s" else 8
        prefix = peek(at, width)
        if len(prefix) < width:
            return None
        at += width + int.from_bytes(prefix, "little")
    return at - start


def remedy_for(magic: bytes) -> str:
    """Return what helps with a file that starts with these bytes, which are no MCAP's."""
    known = (text for start, text in _OTHERS.items() if magic.startswith(start))
    return next(known, "`stadimeter import` makes a recording of a video, or of photos")
