"""Recordings damaged at random, and what the `mcap` library's stream reader keeps of them."""

from __future__ import annotations

import io
import random
import struct
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer
from zstandard import ZstdError

from tests.support.damage import MAGIC_BYTES, records

# What the library lets through where fields do not fit.
_ODD = (struct.error, UnicodeDecodeError, OverflowError)
Found = tuple[int, int, bytes]  # channel id, log time, data
MESSAGES = 60
BASES = tuple(
    (compression, chunked, summary)
    for compression in CompressionType
    for chunked in (True, False)
    for summary in (True, False)
    if chunked or compression is CompressionType.NONE
)


class Damaged(NamedTuple):
    """A damaged file, what was in it, and the messages of its chunks that are still whole."""

    name: str
    data: bytes
    messages: frozenset[Found]
    intact: frozenset[Found]
    checked: bool  # whether CRCs cover all messages


@cache
def whole_file(base: int) -> tuple[bytes, frozenset[Found]]:
    """Return a small recording, and its messages."""
    compression, chunked, summary = BASES[base]
    chance, stream = random.Random(base), io.BytesIO()  # noqa: S311
    indexes = IndexType.ALL if summary else IndexType.NONE
    writer = Writer(
        stream,
        chunk_size=900,
        compression=compression,
        use_chunking=chunked,
        index_types=indexes,
        repeat_channels=summary,
        repeat_schemas=summary,
        use_statistics=summary,
        use_summary_offsets=summary,
        enable_data_crcs=base % 2 == 0,
    )
    writer.start()
    schema = writer.register_schema("S", "jsonschema", b"{}")
    channels = [writer.register_channel(f"/{n}", "json", schema) for n in range(3)]
    found = set()
    for index in range(MESSAGES):
        message = channels[index % 3], index * 1000, chance.randbytes(chance.randrange(20, 200))
        writer.add_message(message[0], message[1], message[2], message[1], sequence=index)
        found.add(message)
    writer.finish()
    return stream.getvalue(), frozenset(found)


def damaged_files(count: int, seed: int = 0) -> Iterator[Damaged]:
    """Yield files in each of which one to three things are wrong."""
    for number in range(count):
        base = number % len(BASES)
        good, messages = whole_file(base)
        chance = random.Random(seed * 1_000_003 + number)  # noqa: S311
        data = good
        for _ in range(chance.choice((1, 1, 1, 2, 3))):
            data = _once(data, good, chance)
        name, intact = f"{number}-{BASES[base]}", frozenset(_intact(good, data))
        yield Damaged(name, data, messages, intact, BASES[base][1] or base % 2 == 0)


def _once(data: bytes, good: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(MAGIC_BYTES, len(data))
    size = chance.choice((1, 1, 2, 9, 40, 300))
    kind = chance.randrange(8)
    if kind == 0:
        return data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]
    if kind == 1:
        return data[:at] + chance.randbytes(size) + data[at + size :]
    if kind == 2:
        return data[:at] + data[at + size :]
    if kind == 3:
        return data[:at] + chance.randbytes(size) + data[at:]
    if kind == 4:
        return data[:at] + bytes(size) + data[at + size :]
    if kind == 5:
        return data[:at] if chance.random() < 0.5 else data[: at + 1]
    if kind == 6:
        return data[:at] + data[max(at - size, MAGIC_BYTES) : at] + data[at:]
    # The head of a record: what the reader steers by.
    heads = [offset for _, offset, _ in records(good) if offset + 9 < len(data)]
    at = chance.choice(heads) + chance.randrange(9)
    return data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]


def _intact(good: bytes, damaged: bytes) -> Iterator[Found]:
    """Yield the messages of the chunks of which every byte is there, if their channels are declared.

    What declares them is the first chunk, or the summary.
    """
    whole = [(op, good[at : at + 9 + length]) for op, at, length in records(good)]
    first = next((r for op, r in whole if op == Opcode.CHUNK), b"none")
    repeated = [r for op, r in whole if op in (Opcode.SCHEMA, Opcode.CHANNEL)]
    if first not in damaged and not (repeated and all(r in damaged for r in repeated)):
        return
    for opcode, at, length in records(good):
        record = good[at : at + 9 + length]
        if opcode == Opcode.CHUNK and record in damaged:
            stream = io.BytesIO(record + struct.pack("<BQ", Opcode.FOOTER, 20) + bytes(20))
            yield from _messages(StreamReader(stream, skip_magic=True, validate_crcs=True))


def library_keeps(data: bytes) -> set[Found]:
    """Return what the stream reader gives before it fails, of channels that it knows by then."""
    return set(_messages(StreamReader(io.BytesIO(data), validate_crcs=True), declared=True))


def _messages(reader: StreamReader, *, declared: bool = False) -> Iterator[Found]:
    known: set[int] = set()
    try:
        for record in reader.records:
            if isinstance(record, Channel):
                known.add(record.id)
            elif isinstance(record, Message) and (record.channel_id in known or not declared):
                yield record.channel_id, record.log_time, record.data
    except (McapError, ZstdError, ValueError, RuntimeError, OSError, EOFError, MemoryError, *_ODD):
        return
