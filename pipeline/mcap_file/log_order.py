"""Messages in the order of their log times, whatever their order in the file, in bounded memory.

The MCAP format asks for no order: boxes may be appended behind the pictures that they are of. A look
at the heads of all records (not at their content) finds those that come too late. Each is read when
its time comes, and is passed over where it stands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from heapq import heapify, heappop, heappush
from itertools import count
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.mcap_file.content import RawMessage
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.losses import MAX_TIME_NS
from pipeline.mcap_file.records import FRAMING, MESSAGE_HEAD
from pipeline.mcap_file.rescue import record_heads
from pipeline.mcap_file.search import RecordSearch
from pipeline.mcap_file.work import Exhausted, Work

_TIMES_BYTES = 16
_LOG_TIME = slice(6, 14)  # in the fields of a message


class Late(NamedTuple):
    """A record that comes too late in the file, by the first log time in it."""

    start_ns: int
    start: int  # where its fields start
    length: int
    opcode: int

    @property
    def offset(self) -> int:
        """Offset at which its record starts."""
        return self.start - FRAMING.size


def late_records(
    source: ForwardFile, search: RecordSearch, work: Work, tolerance_ns: int
) -> list[Late]:
    """Return the chunks and messages that come too late in a recording, the earliest first.

    Args:
        source: the file; the recording starts at its position.
        search: finds the way past damage.
        work: counts the records that are looked at.
        tolerance_ns: how much later than the newest a message may come without being late.
    """
    late, newest_ns = [], 0
    try:
        for head in record_heads(source, source.position, search, work):
            if head.opcode == Opcode.CHUNK and head.length >= _TIMES_BYTES:
                times = source.peek(head.start, _TIMES_BYTES)
                start_ns = int.from_bytes(times[:8], "little")
                end_ns = int.from_bytes(times[8:], "little")
            elif head.opcode == Opcode.MESSAGE and head.length >= MESSAGE_HEAD.size:
                fields = source.peek(head.start, _LOG_TIME.stop)
                start_ns = end_ns = int.from_bytes(fields[_LOG_TIME], "little")
            else:
                continue
            if end_ns > MAX_TIME_NS:
                continue  # no time that can be; it says nothing of the others
            if 0 < start_ns < newest_ns - tolerance_ns:
                late.append(Late(start_ns, head.start, head.length, head.opcode))
            else:
                newest_ns = max(newest_ns, end_ns)
    except Exhausted:
        pass  # who reads the messages tells it
    return sorted(late)


def merged(
    messages: Iterator[RawMessage],
    late: list[Late],
    read: Callable[[Late], Iterator[RawMessage]],
    most_bytes: int,
    tell: Callable[[int], None],
) -> Iterator[RawMessage]:
    """Yield messages in order, each late one when its time comes.

    Args:
        messages: those of the records that are not late.
        late: the records that are, the earliest first.
        read: reads the messages of a late record, in order.
        most_bytes: records of so many bytes are held at once; `tell` is called with the offset of one
            that is given out of order because of that.
        tell: see `most_bytes`.
    """
    heads: list[tuple[int, int, RawMessage, Iterator[RawMessage], int]] = []
    number, held, place = count(), 0, 0

    def put(rest: Iterator[RawMessage], size: int) -> int:
        """Queue the next message of a late record; return the bytes that are held less if it ends."""
        message = next(rest, None)
        if message is None:
            return size
        heappush(heads, (message.log_time_ns, next(number), message, rest, size))
        return 0

    def due(time_ns: float) -> Iterator[RawMessage]:
        nonlocal held, place
        while True:
            if place < len(late) and late[place].start_ns <= min(
                time_ns, heads[0][0] if heads else time_ns
            ):
                record, place = late[place], place + 1
                held += record.length
                held -= put(read(record), record.length)
                if held > most_bytes and len(heads) > 1:
                    tell(record.offset)
                    longest = heads.index(max(heads, key=lambda head: head[4]))
                    _, _, message, rest, size = heads.pop(longest)
                    heapify(heads)
                    yield message
                    yield from rest
                    held -= size
            elif heads and heads[0][0] <= time_ns:
                _, _, message, rest, size = heappop(heads)
                yield message
                held -= put(rest, size)
            else:
                return

    for message in messages:
        if heads or place < len(late):
            yield from due(message.log_time_ns)
        yield message
    yield from due(float("inf"))
