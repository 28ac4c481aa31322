"""Messages in the chunks of a file, and what is lost with a chunk that is damaged."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.mcap_file.channels import ChannelInfo
from pipeline.mcap_file.chunk import (
    WrongContent,
    by_its_crc,
    unpacked,
    unpacked_as_far_as_possible,
)
from pipeline.mcap_file.losses import count_messages, whole_records
from pipeline.mcap_file.reading import Reading
from pipeline.mcap_file.records import (
    FRAMING,
    MESSAGE_HEAD,
    ChunkRecord,
    Malformed,
    content_length,
    read_chunk,
    read_cut_chunk,
)
from pipeline.mcap_file.repeats import Repeats
from pipeline.mcap_file.rescue import declarations_in
from pipeline.mcap_file.search import RecordSearch

# A chunk of a few kilobytes can hold millions of empty records; not each of them is told.
_BAD_RECORDS = 1000
_CHUNK_HEAD_BYTES = 28  # times, size and CRC
_MESSAGE_TIMES = struct.Struct("<BQHIQ")  # opcode, length, channel id, sequence, log time
# First bytes of JPEG, PNG and WebP, which stand after a time, a name and a format.
_PICTURE_HEADS = (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"WEBPVP8")
_PICTURE_REACH = 512

Span = tuple[int | None, int | None]


class RawMessage(NamedTuple):
    """One message, not yet decoded. `byte_offset` is that of its chunk, if it is in one."""

    channel_id: int
    channel: ChannelInfo
    log_time_ns: int
    data: bytes
    byte_offset: int
    publish_time_ns: int = 0
    sequence: int = 0


class Contents:
    """Takes messages out of chunks, and out of message records."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._losses = reading.losses
        self._topics = reading.topics
        self._repeats = Repeats(reading.source)
        self.proven_to = 0  # end of the last chunk whose CRC fits
        self.in_log_order = False  # within each chunk

    def chunk(self, body: bytes | memoryview, offset: int) -> Iterator[RawMessage]:
        """Yield the messages of a chunk whose record starts at `offset`.

        Raises:
            Exhausted: it is more work than the file may cause.
        """
        reading = self._reading
        chunk = self._read_head(body)
        span_ns = chunk.message_start_time, chunk.message_end_time
        self._losses.close_gap(span_ns[0])
        if self._is_repeated(body, chunk, offset):
            return
        try:
            data = unpacked(chunk, reading.limits.chunk_bytes)
        except Malformed as error:
            repaired = by_its_crc(body, reading.limits.chunk_bytes, reading.work)
            if repaired is None:
                self._leave_out(chunk, error, offset)
                return
            text = f"a chunk whose CRC fits was read, though its head is wrong: {error}"
            self._losses.repaired("wrong_chunk_head", text, offset)
            data = repaired
        if chunk.compression:
            reading.work.unpack(len(data))
        messages = self.records(
            memoryview(data), offset, span_ns, proven=bool(chunk.uncompressed_crc)
        )
        if self.in_log_order and not _is_in_order(data, reading.work.records_left):
            yield from sorted(messages, key=_log_time)
        else:
            yield from messages

    def is_chunk(self, offset: int, length: int) -> bool:
        """Return whether the fields of a record of another opcode are a chunk's whose CRC fits."""
        reading = self._reading
        if content_length(Opcode.CHUNK, offset, reading.source.peek) != length:
            return False
        if not _CHUNK_HEAD_BYTES < length <= reading.limits.record_bytes:
            return False
        body = reading.source.peek(offset + FRAMING.size, length)
        return by_its_crc(body, reading.limits.chunk_bytes, reading.work) is not None

    def cut_chunk(self, offset: int, length: int, rest: int) -> Iterator[RawMessage]:
        """Yield the whole messages of the chunk in which the file was cut."""
        reading, losses = self._reading, self._losses
        before, newest_ns = reading.message_counts.total(), losses.newest_ns
        problem = f"a CHUNK record claims {length:,} bytes, {rest:,} are left"
        if rest <= reading.limits.record_bytes:
            chunk = read_cut_chunk(reading.source.read(rest))
            data = unpacked_as_far_as_possible(chunk, reading.limits.chunk_bytes)
            if chunk.compression:
                reading.work.unpack(len(data))
            whole = memoryview(data)[: whole_records(data)]
            yield from self.records(whole, offset, (losses.newest_ns, None), proven=False)
            kept = reading.message_counts.total() - before
            problem += f"; {kept:,} messages of it were kept, which no CRC covers"
        losses.truncated(offset, problem, newest_ns)

    def lone_message(self, body: bytes | memoryview, offset: int) -> RawMessage | None:
        """Return the message of a record outside of chunks; None if it was read before, or is unknown.

        Raises:
            Malformed: it is too short for a message.
        """
        if len(body) < MESSAGE_HEAD.size:
            raise Malformed(f"a message of {len(body)} bytes")
        head = bytes(body[: MESSAGE_HEAD.size])
        first = self._repeats.first_place(head, offset + FRAMING.size, len(body))
        if first is None and not self._repeats.is_recent(head, len(body)):
            return self.message(body, 0, len(body), offset)
        if first is not None and first < self._reading.begin:
            channel_id = self._topics.first_id + int.from_bytes(head[:2], "little")
            self._reading.repeated_counts[channel_id] += 1
        text = "messages that are the same as earlier ones, down to their sequence, were not read twice"
        time_ns = self._losses.newest_ns
        self._losses.tell_span("repeated_message", text, offset, (time_ns, time_ns))
        return None

    def message(
        self, data: bytes | memoryview, start: int, end: int, offset: int
    ) -> RawMessage | None:
        """Return the message between `start` and `end`; None if its channel is unknown."""
        channel_id, sequence, log_time_ns, publish_ns = MESSAGE_HEAD.unpack_from(data, start)
        topics, losses = self._topics, self._losses
        channel_id += topics.first_id
        content = bytes(data[start + MESSAGE_HEAD.size : end])
        channel = topics.channels.get(channel_id) or topics.find(channel_id)
        if channel is None:
            self._lose_unknown(channel_id, content, offset)
            return None
        if topics.before or topics.incomplete:
            self._count_doubtful(channel_id, channel, content)
        losses.newest_ns = log_time_ns
        if losses.in_gap:
            losses.close_gap(log_time_ns)
        self._reading.message_counts[channel_id] += 1
        return RawMessage(channel_id, channel, log_time_ns, content, offset, publish_ns, sequence)

    def records(
        self, data: memoryview, offset: int, span_ns: Span, *, proven: bool
    ) -> Iterator[RawMessage]:
        """Yield the messages among the records of a chunk.

        Args:
            data: the records.
            offset: where the chunk's record starts.
            span_ns: its first and last log time, for what is told.
            proven: its CRC fits.

        Raises:
            Exhausted: there are more records than the file may have.
        """
        head, size, position, bad, work = MESSAGE_HEAD.size, len(data), 0, 0, self._reading.work
        while position < size:
            work.records_left -= 1
            if work.records_left < 0:
                work.read_records()
            start = position + FRAMING.size
            opcode, length = FRAMING.unpack_from(data, position) if start <= size else (0, 0)
            end = start + length
            if opcode == Opcode.MESSAGE and head <= length and end <= size:
                message = self.message(data, start, end, offset)
                self._repeats.remember(bytes(data[start : start + head]), length)
                if message is not None:
                    yield message
            elif opcode == 0 or end > size:
                end = self._search_in(data, position)
                bad += 1
                if bad <= _BAD_RECORDS:
                    text = f"{end - position:,} bytes in a chunk are no record"
                    self._losses.damage("damaged_record", text, offset, *span_ns)
            else:
                problem = self._small_record(opcode, data[start:end], offset, proven=proven)
                bad += problem is not None
                if problem is not None and bad <= _BAD_RECORDS:
                    self._losses.damaged_record(opcode, offset, problem)
            position = end
        if bad > _BAD_RECORDS:
            text = f"{bad - _BAD_RECORDS:,} further bad records in a chunk"
            self._losses.damage("damaged_record", text, offset, *span_ns)

    def _read_head(self, body: bytes | memoryview) -> ChunkRecord:
        """Return a chunk; one whose head is wrong if its CRC shows how it is to be read."""
        try:
            return read_chunk(body)
        except Malformed:
            if by_its_crc(body, self._reading.limits.chunk_bytes, self._reading.work) is None:
                raise
            return read_chunk(bytes(body[:_CHUNK_HEAD_BYTES]) + bytes(12))  # tells what is wrong

    def _is_repeated(self, body: bytes | memoryview, chunk: ChunkRecord, offset: int) -> bool:
        """Return whether the same chunk was read before; it is told."""
        head = bytes(body[:_CHUNK_HEAD_BYTES])
        first = self._repeats.first_place(head, offset + FRAMING.size, len(body))
        if first is None:
            return False
        text = (
            f"a chunk is the same as that at byte {first - FRAMING.size:,}, and was not read twice"
        )
        span_ns = chunk.message_start_time, chunk.message_end_time
        self._losses.tell_span("repeated_chunk", text, offset, span_ns)
        if first < self._reading.begin:  # of a recording whose counts are its own
            for channel_id, count in self._counted(chunk).items():
                self._reading.repeated_counts[channel_id + self._topics.first_id] += count
        return True

    def _counted(self, chunk: ChunkRecord) -> Counter[int]:
        try:
            data = unpacked(chunk, self._reading.limits.chunk_bytes)
        except Malformed:
            return Counter()
        if chunk.compression:
            self._reading.work.unpack(len(data))
        return count_messages(data)

    def _leave_out(self, chunk: ChunkRecord, error: Malformed, offset: int) -> None:
        """Tell that a chunk was left out, and keep what it declares."""
        limit, work = self._reading.limits.chunk_bytes, self._reading.work
        if isinstance(error, WrongContent):
            data = error.data
        else:
            data = unpacked_as_far_as_possible(chunk, limit)
        if chunk.compression:
            work.unpack(len(data))
        self._reading.suspects(declarations_in(data, work))
        span_ns = chunk.message_start_time, chunk.message_end_time
        text = f"a chunk of {len(chunk.data):,} bytes was left out: {error}"
        self._losses.chunk(offset, span_ns, text, count_messages(data))

    def _search_in(self, data: memoryview, position: int) -> int:
        """Return where records go on in a chunk, else its end."""
        search = RecordSearch(_peek_in(data), len(data), self._topics.knows, self._reading.work)
        return search.next_record(position + 1) or len(data)

    def _small_record(
        self, opcode: int, body: memoryview, offset: int, *, proven: bool
    ) -> str | None:
        """Take a record of a chunk that is no whole message; return what is wrong with it.

        As text: an exception that is kept would hold the chunk in memory by its frames.
        """
        try:
            if opcode == Opcode.SCHEMA:
                self._topics.add_schema(bytes(body), proven=proven)
            elif opcode == Opcode.CHANNEL:
                self._topics.add_channel(bytes(body), offset, proven=proven)
            elif opcode == Opcode.MESSAGE:
                raise Malformed(f"a message of {len(body)} bytes")
        except Malformed as error:
            return str(error)
        return None

    def _lose_unknown(self, channel_id: int, content: bytes, offset: int) -> None:
        losses = self._losses
        losses.messages[channel_id] += 1
        picture = _looks_like_a_picture(content)
        losses.pictures += picture
        losses.damage(
            "unknown_channel",
            "messages of a channel that the file does not declare were left out"
            + (", which hold pictures" if picture else ""),
            offset,
            losses.newest_ns,
        )

    def _count_doubtful(self, channel_id: int, channel: ChannelInfo, content: bytes) -> None:
        """Count what is read by a declaration that may be a wrong one, or lacks its schema."""
        if channel_id in self._topics.incomplete:
            self._losses.pictures += _looks_like_a_picture(content)
        elif channel_id in self._topics.before:
            self._losses.misread[self._topics.before[channel_id], channel] += 1


def _looks_like_a_picture(content: bytes) -> bool:
    head = content[:_PICTURE_REACH]
    return any(mark in head for mark in _PICTURE_HEADS)


def _log_time(message: RawMessage) -> int:
    return message.log_time_ns


def _is_in_order(data: bytes | memoryview, most: int) -> bool:
    """Return whether no message of a chunk is older than one before it, among its first records."""
    newest, position, last = 0, 0, len(data) - _MESSAGE_TIMES.size
    unpack = _MESSAGE_TIMES.unpack_from
    while position <= last and most > 0:
        opcode, length, _, _, time_ns = unpack(data, position)
        if opcode == Opcode.MESSAGE:
            if time_ns < newest:
                return False
            newest = time_ns
        elif opcode == 0:
            return True  # no record
        position += FRAMING.size + length
        most -= 1
    return True


def _peek_in(data: memoryview) -> Callable[[int, int], bytes]:
    return lambda offset, count: bytes(data[offset : offset + count])
