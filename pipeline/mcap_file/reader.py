"""Reader from the bytes of an MCAP file to its messages, past damaged parts.

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

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.core.errors import NotARecording, Where
from pipeline.core.records import Severity
from pipeline.mcap_file.attachment import checked_attachment
from pipeline.mcap_file.bag import missing_parts
from pipeline.mcap_file.channels import ChannelInfo, Topics
from pipeline.mcap_file.content import Contents, RawMessage
from pipeline.mcap_file.ends import another_follows, check_counts, check_data_end, is_end
from pipeline.mcap_file.forward_file import ForwardFile, regular_size
from pipeline.mcap_file.log_order import Late, late_records, merged
from pipeline.mcap_file.losses import MAX_TIME_NS, Losses, Note, record_name
from pipeline.mcap_file.reading import Reading
from pipeline.mcap_file.records import (
    FIRST_PRIVATE_OPCODE,
    FRAMING,
    KNOWN_OPCODES,
    MAGIC,
    Malformed,
    MetadataRecord,
    content_length,
    read_message_index,
    read_metadata,
    read_statistics,
    remedy_for,
)
from pipeline.mcap_file.work import Exhausted, Work

__all__ = ["MAX_TIME_NS", "ChannelInfo", "McapFile", "Note", "RawMessage"]

_MOST_ATTACHMENTS = 100_000  # whose places are kept


class McapFile:
    """One walk over the records of a file; afterwards the hash of all its bytes is known.

    Raises:
        NotARecording: the path is of a folder, a pipe or a device.
        OSError: there is no such file.
    """

    def __init__(self, path: Path, limits: Limits, note: Note) -> None:
        """Open nothing yet; `note` receives a diagnostic for each damaged part."""
        self.path = path
        self.size_bytes = regular_size(path)
        self.metadata: list[MetadataRecord] = []
        self.attachments: list[tuple[int, int]] = []  # whose CRC fits: where they start, how long
        self.message_counts: Counter[int] = Counter()
        self.limits = limits
        self._losses = Losses(note, self._channel_of)
        self._topics = Topics(limits, self._losses.tell)
        self._reading: Reading
        self._contents: Contents
        self._late: set[int] = set()  # records that are read before their place is reached
        self._sha256 = ""
        self._metadata_bytes = 0

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

    def pictures_lost(self, is_picture: Callable[[ChannelInfo], bool]) -> int:
        """Return how many pictures are known to be lost.

        Args:
            is_picture: returns whether a channel's messages are pictures.
        """
        return self._losses.pictures_lost(is_picture)

    def messages(self) -> Iterator[RawMessage]:
        """Yield every message that can be read.

        Raises:
            NotARecording: the file is empty, or is no MCAP.
        """
        yield from self._over_recordings(self._walk)

    def messages_by_log_time(self, tolerance_ns: int = 0) -> Iterator[RawMessage]:
        """Yield every message that can be read in the order of log times, whatever that of the file.

        One chunk is held at once, and of chunks that come late those whose times overlap, up to
        `limits.waiting_bytes`; what is more is given out of order, and told (`out_of_order`).

        Args:
            tolerance_ns: messages may come so much later than newer ones; what is late by less is
                left where it stands, which saves reading it out of turn.

        Raises:
            NotARecording: the file is empty, or is no MCAP.
        """
        yield from self._over_recordings(lambda: self._ordered_walk(tolerance_ns))

    def _over_recordings(self, walk: Callable[[], Iterator[RawMessage]]) -> Iterator[RawMessage]:
        with ForwardFile(self.path) as source:
            self._begin(source)
            try:
                while True:
                    yield from walk()
                    check_counts(self._reading)
                    if not another_follows(self._reading):
                        break
            except Exhausted as error:
                self._give_up(error)
            source.skip_to(source.size)  # the hash is of the whole file, read or not
            self._sha256 = source.sha256

    def _begin(self, source: ForwardFile) -> None:
        where = Where(self.path)
        self.size_bytes = source.size
        magic = source.read(len(MAGIC))
        if not magic:
            raise NotARecording("the file is empty", where=where)
        if magic != MAGIC:
            raise NotARecording(
                f"not an MCAP file (it starts with {bytes(magic[:8])!r})",
                where=where,
                remedy=remedy_for(bytes(magic)),
            )
        for name in missing_parts(self.path):
            text = f"the file {name} of the bag is not there; its part of the recording is missing"
            self._losses.tell(Severity.ERROR, "missing_part", text, 0)
        work = Work(self.limits, source.size)
        self._reading = Reading(
            source, self.limits, self._losses, self._topics, work, self.message_counts
        )
        self._contents = Contents(self._reading)

    def _give_up(self, error: Exhausted) -> None:
        """Tell that the rest of a file is not read, as it is more work than the file may cause."""
        self._losses.damage(
            "work_limit",
            f"the rest of the file was not read: {error}; raise the limit in the camera file if the "
            "file is to be trusted",
            self._reading.source.position,
            self._losses.newest_ns,
        )
        check_counts(self._reading)

    def _ordered_walk(self, tolerance_ns: int) -> Iterator[RawMessage]:
        reading = self._reading
        self._contents.in_log_order = True
        late = late_records(reading.source, reading.search, reading.work, tolerance_ns)
        self._late = {record.offset for record in late}
        yield from merged(
            self._walk(), late, self._read_late, self.limits.waiting_bytes, self._tell_disorder
        )

    def _read_late(self, record: Late) -> Iterator[RawMessage]:
        """Yield the messages of a record that is read before its place in the file is reached."""
        if record.length > self.limits.record_bytes:
            self._late.discard(record.offset)  # it is told in its place
            return
        body = self._reading.source.peek(record.start, record.length)
        try:
            yield from self._record(record.opcode, body, record.offset)
        except Malformed as error:
            self._losses.damaged_record(record.opcode, record.offset, error)

    def _tell_disorder(self, offset: int) -> None:
        text = "messages are so far out of order that they were not all sorted; the limit is "
        text += f"limits.waiting_bytes, {self.limits.waiting_bytes:,}"
        self._losses.tell(Severity.WARNING, "out_of_order", text, offset)

    # The walk over the records outside of chunks

    def _walk(self) -> Iterator[RawMessage]:
        """Yield the messages up to the closing magic, or to the end of the file."""
        # A record whose length may be wrong: what follows it may begin before its end.
        source, unsure_from, chunk_to = self._reading.source, None, 0
        while True:
            self._reading.work.read_records()
            offset = source.position
            crc = source.crc if source.peek_next() in (Opcode.DATA_END, Opcode.FOOTER) else 0
            head = source.read(FRAMING.size)
            if len(head) < FRAMING.size:
                self._losses.truncated(offset, "the file ends without a footer")
                return
            opcode, length = FRAMING.unpack(head)
            length = self._mended(offset, opcode, length)
            rest = source.size - source.position
            if opcode == Opcode.CHUNK and rest < length == content_length(
                opcode, offset, source.peek
            ):
                yield from self._contents.cut_chunk(offset, length, rest)
                return
            if self._is_hidden_chunk(opcode, offset, length):
                opcode = Opcode.CHUNK
            if opcode == 0 or length > rest or self._is_out_of_step(opcode, offset, length):
                start = (offset if unsure_from is None else unsure_from) + 1
                resume = self._reading.search.next_record(start, chunk_to)
                if not self._pass_over(offset, opcode, length, resume):
                    return
                unsure_from, chunk_to = None, 0
                continue
            if opcode == Opcode.ATTACHMENT:
                self._check_attachment(offset, length)
                unsure_from, chunk_to = None, 0
                continue
            if length > self.limits.record_bytes:
                self._oversized(opcode, offset, length)
                continue
            if offset in self._late:
                source.skip_to(source.position + length)
                unsure_from, chunk_to = offset, source.position
                continue
            body = source.read(length)
            if len(body) < length:
                self._losses.truncated(offset, "the file shrank while it was read")
                return
            if opcode == Opcode.FOOTER:
                if is_end(self._reading, body, offset, crc):
                    return
                continue
            damage = self._losses.count
            try:
                if opcode == Opcode.DATA_END:
                    check_data_end(self._reading, body, offset, crc)
                else:
                    yield from self._record(opcode, body, offset)
            except Malformed as error:
                self._losses.damaged_record(opcode, offset, error)
            # But for a chunk whose CRC fits, a record's length is its own only witness: what follows
            # it may begin before its end.
            if opcode == Opcode.CHUNK:
                chunk_to = source.position
                unsure_from = None if self._contents.proven_to == chunk_to else offset
            elif self._losses.count == damage:
                unsure_from, chunk_to = offset, 0

    def _mended(self, offset: int, opcode: int, length: int) -> int:
        """Return the length of a record: what its own fields say, if only that leads on."""
        stated = self._reading.search.true_length(offset, opcode, length)
        if stated != length:
            text = (
                f"a {record_name(opcode)} record claims {length:,} bytes and holds {stated:,}; it "
            )
            self._losses.repaired("wrong_length", text + "was read by what it holds", offset)
        return stated

    def _is_hidden_chunk(self, opcode: int, offset: int, length: int) -> bool:
        """Return whether a record is a chunk of which the opcode was changed; it is told."""
        if opcode == Opcode.CHUNK or (
            opcode == Opcode.MESSAGE and self._declares(offset + FRAMING.size)
        ):
            return False
        if not self._contents.is_chunk(offset, length):
            return False
        text = (
            f"a chunk whose CRC fits was read, though it says it is a {record_name(opcode)} record"
        )
        self._losses.repaired("wrong_opcode", text, offset)
        return True

    def _is_out_of_step(self, opcode: int, offset: int, length: int) -> bool:
        """Return whether a record's fields do not fit it, and no record follows it."""
        if opcode == Opcode.CHUNK:
            return False  # its head can be wrong, and its CRC right
        stated = content_length(opcode, offset, self._reading.source.peek)
        if opcode == Opcode.MESSAGE or (stated is not None and stated <= length):
            return False
        return not self._reading.search.leads_on(offset + FRAMING.size + length)

    def _declares(self, start: int) -> bool:
        """Return whether the channel of a message whose fields start here is known."""
        number = int.from_bytes(self._reading.source.peek(start, 2), "little")
        return number + self._topics.first_id in self._topics.channels

    def _record(self, opcode: int, body: bytes | memoryview, offset: int) -> Iterator[RawMessage]:
        if opcode != Opcode.MESSAGE_INDEX:
            self._losses.end_of_indexes(self._topics.first_id)
        if opcode == Opcode.CHUNK:
            yield from self._contents.chunk(body, offset)
        elif opcode == Opcode.MESSAGE:
            message = self._contents.lone_message(body, offset)
            if message is not None:
                yield message
        elif opcode == Opcode.SCHEMA:
            self._topics.add_schema(body, proven=False)
        elif opcode == Opcode.CHANNEL:
            self._topics.add_channel(body, offset, proven=False)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._losses.indexed(*read_message_index(body))
        elif opcode == Opcode.METADATA:
            self._add_metadata(body)
        elif opcode == Opcode.STATISTICS:
            self._reading.stated_counts = read_statistics(body)
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

    def _channel_of(self, channel_id: int) -> ChannelInfo | None:
        return self._topics.find(channel_id)

    def _check_attachment(self, offset: int, length: int) -> None:
        source = self._reading.source
        try:
            place = checked_attachment(source, offset, length, self.limits.name_bytes)
        except Malformed as error:
            self._losses.damage("damaged_attachment", str(error), offset, self._losses.newest_ns)
            return
        if len(self.attachments) < _MOST_ATTACHMENTS:
            self.attachments.append(place)

    # Telling

    def _pass_over(self, offset: int, opcode: int, length: int, resume: int | None) -> bool:
        """Move on to the next record, and say what was passed over; False if there is none."""
        source = self._reading.source
        self._reading.crc_holds = False
        problem = _not_a_record(opcode, length, source.size - source.position)
        if resume is None:
            if self._reading.work.places_left <= 0:
                problem += "; more places look like records than limits.search_places lets be tried"
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
        self._reading.source.skip_to(self._reading.source.position + length)


def _not_a_record(opcode: int, length: int, rest: int) -> str:
    if opcode in KNOWN_OPCODES:
        return f"a {record_name(opcode)} record claims {length:,} bytes, {rest:,} are left"
    return f"no record starts here (opcode {opcode}, length {length:,})"
