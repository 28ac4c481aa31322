"""Reader from the bytes of an MCAP file to its messages, in file order, past damaged parts.

Evidence must not stop at the first damaged record. So the framing (one byte opcode, eight bytes
length) is walked here, bounded by the size of the file; where it breaks, the next place at which
records start is looked for. Every CRC that a file has is checked. A chunk that fails costs that
chunk; of a chunk that is cut off the messages before the cut are kept.

Each loss is told with its place and its time, and the messages that were lost are counted: by the
message indexes behind a bad chunk, by what can still be made out in it, and in the end by the
statistics of the summary.

Source: the MCAP format specification, version 0.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.core.errors import NotARecording, Where
from pipeline.core.records import Severity
from pipeline.mcap_file.attachment import checked_attachment
from pipeline.mcap_file.channels import ChannelInfo, Topics
from pipeline.mcap_file.chunk import WrongContent, unpacked, unpacked_as_far_as_possible
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.losses import (
    MAX_TIME_NS,
    Losses,
    Note,
    count_messages,
    record_name,
    whole_records,
)
from pipeline.mcap_file.records import (
    FIRST_PRIVATE_OPCODE,
    FRAMING,
    KNOWN_OPCODES,
    MAGIC,
    MESSAGE_HEAD,
    ChunkRecord,
    Malformed,
    MetadataRecord,
    content_length,
    read_chunk,
    read_cut_chunk,
    read_data_crc,
    read_footer,
    read_message_index,
    read_metadata,
    read_statistics,
    remedy_for,
)
from pipeline.mcap_file.search import RecordSearch

__all__ = ["MAX_TIME_NS", "ChannelInfo", "McapFile", "Note", "RawMessage"]

_BLOCK = 1 << 20
# A chunk of a few kilobytes can hold millions of empty records; each would be told.
_BAD_RECORDS = 1000
_MOST_ATTACHMENTS = 100_000  # whose places are kept


class RawMessage(NamedTuple):
    """One message, not yet decoded. `byte_offset` is that of its chunk, if it is in one."""

    channel_id: int
    channel: ChannelInfo
    log_time_ns: int
    data: bytes
    byte_offset: int
    publish_time_ns: int = 0
    sequence: int = 0


class McapFile:
    """One walk over the records of a file; afterwards the hash of all its bytes is known."""

    def __init__(self, path: Path, limits: Limits, note: Note) -> None:
        """Open nothing yet; `note` receives a diagnostic for each damaged part."""
        self.path = path
        self.size_bytes = path.stat().st_size
        self.metadata: list[MetadataRecord] = []
        self.attachments: list[tuple[int, int]] = []  # whose CRC fits: where they start, how long
        self.message_counts: Counter[int] = Counter()
        self.limits = limits
        self._losses = Losses(note, self._channel_of)
        self._topics = Topics(limits, self._losses.tell)
        self._source: ForwardFile
        self._search: RecordSearch
        self._sha256 = ""
        self._stated_counts: dict[int, int] = {}
        self._metadata_bytes = 0
        self._crc_holds = True

    @property
    def channels(self) -> dict[int, ChannelInfo]:
        """The channels that were met so far, by id."""
        return self._topics.channels

    @property
    def lost_counts(self) -> Counter[int]:
        """Number of messages that are known to be lost, by channel."""
        return self._losses.messages

    @property
    def damage_count(self) -> int:
        """Counter that rises where a part was left out: a video has a gap there."""
        return self._losses.count

    @property
    def content_sha256(self) -> str:
        """SHA-256 of the whole file; valid after `messages` is exhausted."""
        return self._sha256

    def messages(self) -> Iterator[RawMessage]:
        """Yield every message that can be read.

        Raises:
            NotARecording: the file is empty, or is no MCAP.
        """
        where = Where(self.path)
        with ForwardFile(self.path) as source:
            self._source = self._topics.source = source
            magic = source.read(len(MAGIC))
            if not magic:
                raise NotARecording("the file is empty", where=where)
            if magic != MAGIC:
                raise NotARecording(
                    f"not an MCAP file (it starts with {magic[:8]!r})",
                    where=where,
                    remedy=remedy_for(bytes(magic)),
                )
            self._search = RecordSearch(
                source.peek, source.size, self._topics.knows, self.limits.search_places
            )
            while True:
                yield from self._walk()
                self._close_recording()
                if not self._another_follows():
                    break
            source.skip_to(source.size)  # the hash is of the whole file, read or not
            self._sha256 = source.sha256

    # The walk over the records outside of chunks

    def _walk(self) -> Iterator[RawMessage]:
        """Yield the messages up to the closing magic, or to the end of the file."""
        source, unsure_from = self._source, None
        while True:
            offset = source.position
            crc = source.crc if source.peek_next() in (Opcode.DATA_END, Opcode.FOOTER) else 0
            head = source.read(FRAMING.size)
            if len(head) < FRAMING.size:
                self._losses.truncated(offset, "the file ends without a footer")
                return
            opcode, length = FRAMING.unpack(head)
            length = self._mended(offset, opcode, length)
            rest = source.size - source.position
            if opcode == 0 or length > rest:
                if opcode == Opcode.CHUNK and length == content_length(opcode, offset, source.peek):
                    yield from self._cut_chunk(offset, length, rest)
                    return
                resume = self._search.next_record((unsure_from or offset) + 1)
                if not self._pass_over(offset, opcode, length, resume):
                    return
                unsure_from = None
                continue
            # The length of a message that is in no chunk is its own only witness.
            unsure_from = offset if opcode == Opcode.MESSAGE else None
            if opcode == Opcode.ATTACHMENT:
                self._check_attachment(offset, length)
                continue
            if length > self.limits.record_bytes:
                self._oversized(opcode, offset, length)
                continue
            body = source.read(length)
            if len(body) < length:
                self._losses.truncated(offset, "the file shrank while it was read")
                return
            if opcode == Opcode.FOOTER:
                if self._is_end(body, offset, crc):
                    return
                continue
            try:
                if opcode == Opcode.DATA_END:
                    self._check_data_end(body, offset, crc)
                else:
                    yield from self._record(opcode, body, offset)
            except Malformed as error:
                self._losses.damaged_record(opcode, offset, error)

    def _mended(self, offset: int, opcode: int, length: int) -> int:
        """Return the length of a record: what its own fields say, if only that leads on."""
        stated = self._search.true_length(offset, opcode, length)
        if stated != length:
            self._losses.damage(
                "wrong_length",
                f"a {record_name(opcode)} record claims {length:,} bytes and holds {stated:,}; it "
                "was read by what it holds",
                offset,
            )
        return stated

    def _record(self, opcode: int, body: bytes | memoryview, offset: int) -> Iterator[RawMessage]:
        if opcode != Opcode.MESSAGE_INDEX:
            self._losses.end_of_indexes(self._topics.first_id)
        if opcode == Opcode.CHUNK:
            yield from self._chunk(read_chunk(body), offset)
        elif opcode == Opcode.MESSAGE:
            if len(body) < MESSAGE_HEAD.size:
                raise Malformed(f"a message of {len(body)} bytes")
            message = self._message(body, 0, len(body), offset)
            if message is not None:
                yield message
        elif opcode == Opcode.SCHEMA:
            self._topics.add_schema(body)
        elif opcode == Opcode.CHANNEL:
            self._topics.add_channel(body, offset)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._losses.indexed(*read_message_index(body))
        elif opcode == Opcode.METADATA:
            self._add_metadata(body)
        elif opcode == Opcode.STATISTICS:
            self._stated_counts = read_statistics(body)
        elif opcode not in KNOWN_OPCODES and opcode < FIRST_PRIVATE_OPCODE:
            self._losses.tell(
                Severity.INFO, "unknown_record", f"records of opcode {opcode} are not known", offset
            )

    def _add_metadata(self, body: bytes | memoryview) -> None:
        self._metadata_bytes += len(body)
        limit = self.limits.metadata_bytes
        if self._metadata_bytes > limit:
            raise Malformed(f"metadata of more than {limit:,} bytes in all")
        self.metadata.append(read_metadata(body, self.limits.name_bytes, limit))

    # Chunks

    def _chunk(self, chunk: ChunkRecord, offset: int) -> Iterator[RawMessage]:
        start_ns, end_ns = chunk.message_start_time, chunk.message_end_time
        self._losses.close_gap(start_ns)
        try:
            data = unpacked(chunk, self.limits.chunk_bytes)
        except Malformed as error:
            seen = count_messages(error.data) if isinstance(error, WrongContent) else Counter[int]()
            text = f"a chunk of {len(chunk.data):,} bytes was left out: {error}"
            self._losses.chunk(offset, (start_ns, end_ns), text, seen)
            return
        yield from self._records_in(memoryview(data), offset, (start_ns, end_ns))

    def _records_in(
        self, data: memoryview, offset: int, span_ns: tuple[int, int] | None = None
    ) -> Iterator[RawMessage]:
        """Yield the messages among the records of a chunk."""
        head, size, position, bad = MESSAGE_HEAD.size, len(data), 0, 0
        while position < size:
            start = position + FRAMING.size
            opcode, length = FRAMING.unpack_from(data, position) if start <= size else (0, 0)
            end = start + length
            if opcode == Opcode.MESSAGE and head <= length and end <= size:
                message = self._message(data, start, end, offset)
                if message is not None:
                    yield message
            elif opcode == 0 or end > size:
                search = RecordSearch(_peek_in(data), size, self._topics.knows, self._search.budget)
                resume = search.next_record(position + 1)
                self._search.budget = search.budget
                self._losses.damage(
                    "damaged_record",
                    f"{(resume or size) - position:,} bytes in a chunk are no record",
                    offset,
                    *(span_ns or (self._losses.newest_ns, None)),
                )
                end = resume or size
            elif not self._small_record(opcode, data[start:end], offset):
                bad += 1
                if bad > _BAD_RECORDS:
                    text = f"more than {_BAD_RECORDS:,} bad records in a chunk; the rest was left"
                    self._losses.damage(
                        "damaged_record", text, offset, *(span_ns or (self._losses.newest_ns, None))
                    )
                    return
            position = end

    def _message(
        self, data: bytes | memoryview, start: int, end: int, offset: int
    ) -> RawMessage | None:
        """Return the message between `start` and `end`; None if its channel is unknown."""
        channel_id, sequence, log_time_ns, publish_ns = MESSAGE_HEAD.unpack_from(data, start)
        channel_id += self._topics.first_id
        channel = self._topics.channels.get(channel_id) or self._from_summary(channel_id, offset)
        if channel is None:
            return None
        self._losses.newest_ns = log_time_ns
        if self._losses.in_gap:
            self._losses.close_gap(log_time_ns)
        self.message_counts[channel_id] += 1
        content = bytes(data[start + MESSAGE_HEAD.size : end])
        return RawMessage(channel_id, channel, log_time_ns, content, offset, publish_ns, sequence)

    def _small_record(self, opcode: int, body: memoryview, offset: int) -> bool:
        """Take a record of a chunk that is no whole message; False if it is damaged."""
        try:
            if opcode == Opcode.SCHEMA:
                self._topics.add_schema(bytes(body))
            elif opcode == Opcode.CHANNEL:
                self._topics.add_channel(bytes(body), offset)
            elif opcode == Opcode.MESSAGE:
                raise Malformed(f"a message of {len(body)} bytes")
        except Malformed as error:
            self._losses.damaged_record(opcode, offset, error)
            return False
        return True

    def _channel_of(self, channel_id: int) -> ChannelInfo | None:
        return self.channels.get(channel_id) or self._topics.from_summary(channel_id, None)

    def _from_summary(self, channel_id: int, offset: int) -> ChannelInfo | None:
        """Return a channel whose own record was lost, if the summary repeats it."""
        found = self._topics.from_summary(channel_id, offset)
        if found is None:
            self._losses.damage(
                "unknown_channel",
                "messages of a channel that the file does not declare were left out",
                offset,
                self._losses.newest_ns,
            )
        return found

    def _cut_chunk(self, offset: int, length: int, rest: int) -> Iterator[RawMessage]:
        """Yield the whole messages of the chunk in which the file was cut."""
        before, newest_ns = self.message_counts.total(), self._losses.newest_ns
        problem = f"a CHUNK record claims {length:,} bytes, {rest:,} are left"
        if rest <= self.limits.record_bytes:
            chunk = read_cut_chunk(self._source.read(rest))
            data = unpacked_as_far_as_possible(chunk, self.limits.chunk_bytes)
            yield from self._records_in(memoryview(data)[: whole_records(data)], offset)
            kept = self.message_counts.total() - before
            problem += f"; {kept:,} messages of it were kept, which no CRC covers"
        self._losses.truncated(offset, problem, newest_ns)

    # Its ends

    def _close_recording(self) -> None:
        """At the end: hold what was read against what the summary counted."""
        self._losses.end_of_indexes(self._topics.first_id)
        self._losses.close_gap(None)
        for stated_id, stated in self._stated_counts.items():
            channel_id = stated_id + self._topics.first_id
            missing = stated - self.message_counts[channel_id] - self.lost_counts[channel_id]
            # A count that no file can hold is not believed.
            if 0 < missing <= self._source.size:
                self._losses.lose(
                    channel_id, missing, "messages that the summary counts were not found"
                )
        self._stated_counts = {}

    def _check_data_end(self, body: bytes | memoryview, offset: int, crc: int) -> None:
        expected = read_data_crc(body)
        if expected and self._crc_holds and expected != crc:
            self._losses.damage(
                "data_crc",
                "the CRC of the data section does not fit: bytes outside the chunks' own CRCs, "
                "or inside a chunk reported above, were changed",
                offset,
            )
        self._crc_holds = True
        self._source.restart_crc()

    def _is_end(self, body: bytes | memoryview, offset: int, crc: int) -> bool:
        """Check the footer and the magic behind it; a footer in the middle is none."""
        source = self._source
        after = source.peek(source.position, len(MAGIC))
        if (
            after != MAGIC
            and self._search.leads_on(source.position)
            and source.position < source.size
        ):
            self._losses.damage("damaged_record", "a footer in the middle was passed over", offset)
            return False
        try:
            expected = read_footer(body).summary_crc
        except Malformed as error:
            self._losses.damaged_record(Opcode.FOOTER, offset, error)
            return True
        inside = FRAMING.pack(Opcode.FOOTER, len(body)) + bytes(body[:16])
        if expected and self._crc_holds and expected != zlib.crc32(inside, crc):
            self._losses.damage(
                "summary_crc",
                "the CRC of the summary does not fit; no frame comes from there, what the summary "
                "repeats was taken from the records",
                offset,
            )
        if source.read(len(MAGIC)) != MAGIC:
            self._losses.damage("truncated_file", "the magic bytes at the end are missing", offset)
        return True

    def _another_follows(self) -> bool:
        """Return whether another recording, or a lost part of this one, follows behind the end."""
        source = self._source
        start = source.position
        if start >= source.size:
            return False
        if source.peek(start, len(MAGIC)) == MAGIC:
            source.skip_to(start + len(MAGIC))
            text = "another recording follows in the same file; it was read too"
            self._losses.tell(Severity.INFO, "another_recording", text, start)
        else:
            resume = self._search.next_record(start)
            self._losses.damage(
                "bytes_after_end",
                f"{(resume or source.size) - start:,} bytes behind the end are no record",
                start,
                self._losses.newest_ns,
            )
            if resume is None:
                return False
            source.skip_to(resume)
        self._topics.begin_another()
        self._crc_holds = False  # it starts with the magic, which may be gone
        return True

    def _check_attachment(self, offset: int, length: int) -> None:
        try:
            place = checked_attachment(self._source, offset, length, self.limits.name_bytes)
        except Malformed as error:
            self._losses.damage("damaged_attachment", str(error), offset, self._losses.newest_ns)
            return
        if len(self.attachments) < _MOST_ATTACHMENTS:
            self.attachments.append(place)

    # Telling

    def _pass_over(self, offset: int, opcode: int, length: int, resume: int | None) -> bool:
        """Move on to the next record, and say what was passed over; False if there is none."""
        source = self._source
        self._crc_holds = False
        problem = _not_a_record(opcode, length, source.size - source.position)
        if resume is None:
            self._losses.truncated(offset, problem)
            source.skip_to(source.size)
            return False
        self._losses.open_gap(offset, f"{problem}; records go on at byte {resume:,}")
        source.skip_to(resume)
        return True

    def _oversized(self, opcode: int, offset: int, length: int) -> None:
        self._losses.damage(
            "oversized_record",
            f"a {record_name(opcode)} record of {length:,} bytes was left out, the limit "
            f"limits.record_bytes is {self.limits.record_bytes:,}",
            offset,
            self._losses.newest_ns,
        )
        self._source.skip_to(self._source.position + length)


def _not_a_record(opcode: int, length: int, rest: int) -> str:
    if opcode in KNOWN_OPCODES:
        return f"a {record_name(opcode)} record claims {length:,} bytes, {rest:,} are left"
    return f"no record starts here (opcode {opcode}, length {length:,})"


def _peek_in(data: memoryview) -> Callable[[int, int], bytes]:
    return lambda offset, count: bytes(data[offset : offset + count])
