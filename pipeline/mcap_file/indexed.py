"""The messages of some topics by the index of a file that is known to be whole.

Nothing is checked again, and no message is copied: its bytes are a view of its chunk, and good until
the next message is asked for.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from io import SEEK_END, BufferedReader
from typing import NamedTuple

from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import ChunkIndex
from mcap.summary import Summary

from pipeline.mcap_file.chunk import unpacked
from pipeline.mcap_file.records import FRAMING, MESSAGE_HEAD, Malformed, read_chunk


class IndexedMessage(NamedTuple):
    """A message where it stands in its chunk."""

    topic: str
    log_time_ns: int
    data: memoryview


def summary_of(stream: BufferedReader) -> Summary | None:
    """Return what stands at the end of a file.

    Raises:
        McapError, ValueError, OSError: it cannot be read.
    """
    return SeekingReader(stream).get_summary()


def indexed_messages(
    stream: BufferedReader,
    summary: Summary,
    topics: Collection[str],
    span_ns: tuple[int, int] | None,
    chunk_bytes: int,
) -> Iterator[IndexedMessage]:
    """Yield the messages of topics, in file order, out of the chunks that reach into a span.

    Args:
        stream: the file.
        summary: its own.
        topics: whose messages are wanted.
        span_ns: log times, both included; all if there is none.
        chunk_bytes: what a chunk may hold.
    """
    size = stream.seek(0, SEEK_END)
    buffer = bytearray()  # of all chunks: fresh memory costs more than what is read into it
    wanted = {i: c.topic for i, c in summary.channels.items() if c.topic in topics}
    chunks = [i for i in summary.chunk_indexes if _is_wanted(i, wanted, span_ns)]
    for index in sorted(chunks, key=lambda index: index.chunk_start_offset):
        length = index.chunk_length - FRAMING.size
        if not 0 < length <= size:
            continue
        stream.seek(index.chunk_start_offset + FRAMING.size)
        if length > len(buffer):
            buffer = bytearray(length)
        record = memoryview(buffer)[:length]
        try:
            chunk = read_chunk(record[: stream.readinto(record)])
            content = memoryview(unpacked(chunk._replace(uncompressed_crc=0), chunk_bytes))
        except Malformed:
            continue  # the file has changed since it was found whole
        yield from _messages_in(content, wanted)


def _is_wanted(index: ChunkIndex, topics: dict[int, str], span_ns: tuple[int, int] | None) -> bool:
    if index.message_index_offsets and topics.keys().isdisjoint(index.message_index_offsets):
        return False
    return span_ns is None or (
        index.message_end_time >= span_ns[0] and index.message_start_time <= span_ns[1]
    )


def _messages_in(content: memoryview, topics: dict[int, str]) -> Iterator[IndexedMessage]:
    position, size = 0, len(content)
    while position + FRAMING.size <= size:
        opcode, length = FRAMING.unpack_from(content, position)
        start = position + FRAMING.size
        position = start + length
        if opcode != Opcode.MESSAGE or length < MESSAGE_HEAD.size or position > size:
            continue
        channel_id, _, log_time_ns, _ = MESSAGE_HEAD.unpack_from(content, start)
        if channel_id in topics:
            data = content[start + MESSAGE_HEAD.size : position]
            yield IndexedMessage(topics[channel_id], log_time_ns, data)
