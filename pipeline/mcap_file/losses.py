"""Losses in a damaged file, each with its place, its time, and the messages that were lost with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.core.records import Diagnostic, Severity
from pipeline.mcap_file.channels import ChannelInfo
from pipeline.mcap_file.records import FRAMING, KNOWN_OPCODES, MESSAGE_HEAD

MAX_TIME_NS = 2**63 - 1  # what Arrow and DuckDB hold

Note = Callable[[Diagnostic], None]


class _Chunk(NamedTuple):
    """A chunk that was left out, until the message indexes behind it were read."""

    offset: int
    start_ns: int
    end_ns: int
    counts: Counter[int]  # messages by channel


class Losses:
    """Notes every loss of a file once it is known what it took.

    Args:
        note: receives the diagnostics.
        channel_of: the channel of an id, None if it is not known.
    """

    def __init__(self, note: Note, channel_of: Callable[[int], ChannelInfo | None]) -> None:
        self.count = 0  # rises wherever something was left out
        self.messages: Counter[int] = Counter()  # that are known to be lost, by channel
        # The same by the channel as it was declared then: an id may be declared anew.
        self.by_channel: Counter[ChannelInfo | None] = Counter()
        self.pictures = (
            0  # lost messages of channels unknown that hold a picture, as its head shows
        )
        # Messages that were read by a channel declared anew: the first declaration, and the new one.
        self.misread: Counter[tuple[ChannelInfo, ChannelInfo]] = Counter()
        self.newest_ns: int | None = None  # log time of the last message that was read
        self.in_gap = False
        self._note = note
        self._channel_of = channel_of
        self._gap: Diagnostic | None = None  # told when the time is known at which it ends
        self._chunk: _Chunk | None = None

    def damage(
        self,
        code: str,
        message: str,
        offset: int | None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        *,
        topic: str | None = None,
        count: int = 1,
    ) -> None:
        """Note that something was left out."""
        self.count += 1
        found = _diagnostic(Severity.ERROR, code, message, offset, start_ns, end_ns)
        self._note(replace(found, topic=topic, count=count))

    def repaired(self, code: str, message: str, offset: int) -> None:
        """Note damage by which nothing is lost."""
        self._note(_diagnostic(Severity.ERROR, code, message, offset, self.newest_ns))

    def tell(
        self,
        severity: Severity,
        code: str,
        message: str,
        offset: int | None,
        topic: str | None = None,
    ) -> None:
        """Note something by which nothing is lost."""
        self._note(replace(_diagnostic(severity, code, message, offset), topic=topic))

    def tell_span(
        self, code: str, message: str, offset: int, span_ns: tuple[int | None, int | None]
    ) -> None:
        """Warn of something in a span of time by which nothing is lost."""
        self._note(_diagnostic(Severity.WARNING, code, message, offset, *span_ns))

    def pictures_lost(self, is_picture: Callable[[ChannelInfo], bool]) -> int:
        """Return how many pictures are known to be lost.

        Args:
            is_picture: returns whether a channel's messages are pictures.
        """
        by_channel = sum(n for c, n in self.by_channel.items() if c is not None and is_picture(c))
        misread = sum(
            n
            for (first, now), n in self.misread.items()
            if is_picture(first) and not is_picture(now)
        )
        return by_channel + misread + self.pictures

    def truncated(self, offset: int, problem: str, time_ns: int | None = None) -> None:
        """Note that the file ends too early."""
        self.damage(
            "truncated_file",
            f"{problem}; every whole record before it was kept",
            offset,
            self.newest_ns if time_ns is None else time_ns,
        )

    def damaged_record(self, opcode: int, offset: int, error: Exception | str) -> None:
        """Note that one record was left out."""
        text = f"a {record_name(opcode)} record was left out: {error}"
        self.damage("damaged_record", text, offset, self.newest_ns)

    def open_gap(self, offset: int, problem: str) -> None:
        """Note bytes that were passed over; when they end is known at the next message."""
        self.close_gap(None)
        self.count += 1
        self.in_gap = True
        self._gap = _diagnostic(Severity.ERROR, "lost_place", problem, offset, self.newest_ns)

    def close_gap(self, time_ns: int | None) -> None:
        """Note the bytes that were passed over last, which end before this time."""
        gap, self._gap, self.in_gap = self._gap, None, False
        if gap is not None:
            self._note(gap if time_ns is None else replace(gap, end_time_ns=_clamped(time_ns)))

    def chunk(
        self, offset: int, span_ns: tuple[int, int], problem: str, counts: Counter[int]
    ) -> None:
        """Note a chunk that was left out; `counts` are its messages as far as they can be seen."""
        self.damage("damaged_chunk", problem, offset, *span_ns)
        self._chunk = _Chunk(offset, *span_ns, counts)

    def indexed(self, channel_id: int, count: int) -> None:
        """Take the count of a message index behind a damaged chunk: it is the chunk's own."""
        if self._chunk is not None and count:
            self._chunk.counts[channel_id] = count

    def end_of_indexes(self, first_id: int) -> None:
        """Note how many messages of which topic a damaged chunk took with it."""
        chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        for channel_id, count in chunk.counts.items():
            self.lose(
                channel_id + first_id,
                count,
                "messages were lost with a damaged chunk",
                (chunk.offset, chunk.start_ns, chunk.end_ns),
            )

    def lose(
        self,
        channel_id: int,
        count: int,
        how: str,
        place: tuple[int | None, int | None, int | None] = (None, None, None),
    ) -> None:
        """Note messages that were lost."""
        channel = self._channel_of(channel_id)
        self.messages[channel_id] += count
        self.by_channel[channel] += count
        self.damage(
            "lost_messages",
            how + (f" ({channel.schema_name})" if channel else ""),
            *place,
            topic=channel.topic if channel else None,
            count=count,
        )


def _diagnostic(
    severity: Severity,
    code: str,
    message: str,
    offset: int | None,
    start_ns: int | None = None,
    end_ns: int | None = None,
) -> Diagnostic:
    return Diagnostic(
        severity,
        code,
        message,
        byte_offset=offset,
        log_time_ns=_clamped(start_ns),
        end_time_ns=_clamped(end_ns),
    )


def _clamped(time_ns: int | None) -> int | None:
    return None if time_ns is None else min(time_ns, MAX_TIME_NS)


def record_name(opcode: int) -> str:
    """Return what a record is called."""
    return Opcode(opcode).name if opcode in KNOWN_OPCODES else f"opcode {opcode}"


def whole_records(data: bytes | memoryview) -> int:
    """Return how many bytes the whole records at the beginning take."""
    position = 0
    while position + FRAMING.size <= len(data):
        opcode, length = FRAMING.unpack_from(data, position)
        end = position + FRAMING.size + length
        if opcode == 0 or end > len(data):
            break
        position = end
    return position


def count_messages(data: bytes | memoryview) -> Counter[int]:
    """Return how many messages a damaged chunk seems to hold, by channel, as far as it is whole."""
    counts: Counter[int] = Counter()
    position = 0
    while position + FRAMING.size <= len(data):
        opcode, length = FRAMING.unpack_from(data, position)
        position += FRAMING.size
        if opcode == 0 or length > len(data) - position:
            break
        if opcode == Opcode.MESSAGE and length >= MESSAGE_HEAD.size:
            counts[int.from_bytes(data[position : position + 2], "little")] += 1
        position += length
    return counts
