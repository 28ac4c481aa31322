"""Declarations of schemas and channels that survive where a reader has not been yet, or not believed.

Only a file whose own declarations are damaged is searched: its summary first, then the records
between its chunks, then whole chunks that come later, and last chunks whose CRC does not fit.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.mcap_file.chunk import unpacked
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.records import FRAMING, MAGIC, Malformed, read_chunk
from pipeline.mcap_file.search import RecordSearch
from pipeline.mcap_file.work import Exhausted, Work

DECLARATIONS = (Opcode.SCHEMA, Opcode.CHANNEL)


class Head(NamedTuple):
    """A record outside of chunks: where its fields start, and how long they are."""

    opcode: int
    start: int
    length: int


def record_heads(
    source: ForwardFile, start: int, search: RecordSearch, work: Work
) -> Iterator[Head]:
    """Yield the records from an offset to the next footer, without reading them.

    Raises:
        Exhausted: there are more than the file may have.
    """
    offset = start
    while offset + FRAMING.size <= source.size:
        work.read_records()
        opcode, length = FRAMING.unpack(source.peek(offset, FRAMING.size))
        end = offset + FRAMING.size + length
        if opcode == 0 or end > source.size:
            resume = search.next_record(offset + 1)
            if resume is None:
                return
            offset = resume
            continue
        yield Head(opcode, offset + FRAMING.size, length)
        offset = end
        if opcode == Opcode.FOOTER and source.peek(end, len(MAGIC)) in (MAGIC, b""):
            return


def declarations_between_chunks(
    source: ForwardFile, start: int, search: RecordSearch, work: Work, limits: Limits
) -> Iterator[tuple[int, bytes]]:
    """Yield schemas and channels outside of chunks, from an offset on."""
    try:
        for head in record_heads(source, start, search, work):
            if head.opcode in DECLARATIONS and head.length <= limits.record_bytes:
                yield head.opcode, source.peek(head.start, head.length)
    except Exhausted:
        return  # who reads on tells it


def declarations_in_chunks(
    source: ForwardFile, start: int, search: RecordSearch, work: Work, limits: Limits
) -> Iterator[tuple[int, bytes]]:
    """Yield schemas and channels in the whole chunks from an offset on."""
    try:
        for head in record_heads(source, start, search, work):
            if head.opcode != Opcode.CHUNK or head.length > limits.record_bytes:
                continue
            try:
                chunk = read_chunk(source.peek(head.start, head.length))
                data = unpacked(chunk, limits.chunk_bytes)
            except Malformed:
                continue
            if chunk.compression:
                work.unpack(len(data))
            yield from declarations_in(data, work)
    except Exhausted:
        return


def declarations_in(data: bytes | memoryview, work: Work) -> Iterator[tuple[int, bytes]]:
    """Yield schemas and channels among the records of a chunk, up to where they are no records.

    Raises:
        Exhausted: there are more records than the file may have.
    """
    position = 0
    while position + FRAMING.size <= len(data):
        work.read_records()
        opcode, length = FRAMING.unpack_from(data, position)
        start = position + FRAMING.size
        position = start + length
        if opcode == 0 or position > len(data):
            return
        if opcode in DECLARATIONS:
            yield opcode, bytes(data[start:position])
