"""Values that were logged long after their pictures: boxes appended to a recording, for one.

Such values have the stamps of their pictures, but come when these are gone. They are read first.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.core.records import Diagnostic, Severity
from pipeline.ingest.waiting import LONGEST_NS
from pipeline.mcap_file.channels import ChannelInfo
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.reader import McapFile, RawMessage
from pipeline.mcap_file.records import MAGIC, MESSAGE_HEAD
from pipeline.mcap_file.rescue import record_heads
from pipeline.mcap_file.search import RecordSearch
from pipeline.mcap_file.summary import statistics_of
from pipeline.mcap_file.work import Exhausted, Work
from pipeline.messages.content import Kind
from pipeline.messages.registry import kind_of

PICTURES = (Kind.IMAGE, Kind.VIDEO)
# What is said once, or anew when it changes, holds on from its log time; all else is of a moment.
_OF_A_MOMENT = (Kind.DETECTIONS, Kind.TRUTH, Kind.EXPOSURE)


class Order(NamedTuple):
    """Order in which a recording is to be read."""

    behind: frozenset[str]  # topics whose messages are logged too long after the pictures
    as_in_file: bool  # the recorder's clock was set back, so that log times came twice


def order_of(path: Path, limits: Limits, *, look_again: bool) -> Order:
    """Return how a recording is to be read, so that what belongs together comes together.

    Args:
        path: the recording.
        limits: bounds of reading it.
        look_again: read all messages if the file has no index; else nothing is known of such a file.
    """
    spans = spans_by_index(path, limits)
    if spans is None:
        spans = spans_by_messages(path, limits) if look_again else []
    pictures = [span for info, span in spans if kind_of(info) in PICTURES]
    if not pictures:
        return Order(frozenset(), False)
    first_ns = min(span.first_ns for span in pictures)
    median_ns = max(span.median_ns for span in pictures)
    behind = {
        info.topic
        for info, span in spans
        if kind_of(info) in _OF_A_MOMENT
        and span.first_ns > first_ns + LONGEST_NS
        and span.median_ns > median_ns + LONGEST_NS
    }
    return Order(frozenset(behind), any(span.set_back for span in pictures))


def order_notes(order: Order) -> Iterator[Diagnostic]:
    """Yield what is to be told of the order in which a recording is read."""
    for topic in sorted(order.behind):
        text = "its messages are logged long after the pictures; they were read before these"
        yield Diagnostic(Severity.INFO, "logged_behind", text, topic=topic)
    if order.as_in_file:
        text = (
            "log times come twice: the recorder's clock was set back; messages were used in their "
        )
        yield Diagnostic(Severity.WARNING, "clock_step", text + "order in the file")


def messages_behind(path: Path, limits: Limits, order: Order) -> Iterator[RawMessage]:
    """Yield the messages that are read first; what is damaged is told by who reads the rest."""
    if order.behind:
        for raw in McapFile(path, limits, lambda _: None).messages():
            if raw.channel.topic in order.behind:
                yield raw


def messages_in_order(file: McapFile, order: Order, tolerance_ns: int) -> Iterator[RawMessage]:
    """Yield all other messages: by log time, or as they stand where log times come twice."""
    in_file = order.as_in_file
    for raw in file.messages() if in_file else file.messages_by_log_time(tolerance_ns):
        if raw.channel.topic not in order.behind:
            yield raw


# A clock that was set back by less is taken for messages that are late.
_STEP_NS = 250_000_000
_MOST_RUNS, _FEWEST = 8, 3
_INDEX_HEAD = 6  # channel id and length of the array
_MOST = 100_000  # times of one channel that are kept; then every second one


class Span(NamedTuple):
    """Log times of the messages of a channel: of the earliest, their median, and if they came twice."""

    first_ns: int
    median_ns: int
    set_back: bool


class _Runs:
    """Stretches of a channel in which log times rise, in the order of the file."""

    def __init__(self) -> None:
        self._runs: list[list[int]] = []  # first, last, count

    def add(self, time_ns: int) -> None:
        if self._runs and time_ns >= self._runs[-1][1] - _STEP_NS:
            run = self._runs[-1]
            run[1], run[2] = max(run[1], time_ns), run[2] + 1
        elif len(self._runs) <= _MOST_RUNS:
            self._runs.append([time_ns, time_ns, 1])

    @property
    def overlap(self) -> bool:
        """Return whether times that were there come again: the clock was set back.

        Chunks that are out of order have stretches that lie beside each other.
        """
        runs = self._runs
        return len(runs) <= _MOST_RUNS and any(
            min(a[1], b[1]) - max(a[0], b[0]) > _STEP_NS and min(a[2], b[2]) >= _FEWEST
            for a, b in pairwise(runs)
        )


class _Times:
    def __init__(self) -> None:
        self._times: dict[int, list[int]] = defaultdict(list)
        self._first: dict[int, int] = {}
        self._runs: dict[int, _Runs] = defaultdict(_Runs)

    def add(self, channel_id: int, times_ns: list[int]) -> None:
        if not times_ns:
            return
        first_ns = min(times_ns)
        self._first[channel_id] = min(self._first.get(channel_id, first_ns), first_ns)
        for time_ns in times_ns:
            self._runs[channel_id].add(time_ns)
        kept = self._times[channel_id]
        kept.extend(times_ns)
        if len(kept) > _MOST:
            del kept[::2]

    def spans(self) -> dict[int, Span]:
        return {
            channel_id: Span(
                self._first[channel_id],
                int(np.median(np.array(times, np.float64))),
                self._runs[channel_id].overlap,
            )
            for channel_id, times in self._times.items()
        }


def spans_by_index(path: Path, limits: Limits) -> list[tuple[ChannelInfo, Span]] | None:
    """Return the spans of the channels of a file without reading its messages.

    None: the file has no summary, or chunks without indexes.
    """
    statistics = statistics_of(path, limits)
    if statistics is None:
        return None
    times, bare_chunk = _Times(), False
    with ForwardFile(path) as source:
        end = source.size - len(MAGIC)
        work = Work(limits, source.size)
        search = RecordSearch(source.peek, source.size, lambda _: True, work)
        try:
            for head in record_heads(source, len(MAGIC), search, work):
                if head.opcode == Opcode.FOOTER and head.start + head.length < end:
                    return None  # another recording follows, whose channels have other numbers
                if head.opcode == Opcode.CHUNK:
                    if bare_chunk:
                        return None
                    bare_chunk = True
                elif head.opcode == Opcode.MESSAGE_INDEX and head.length <= limits.record_bytes:
                    body = source.peek(head.start, head.length)
                    count = max(head.length - _INDEX_HEAD, 0) // 16
                    entries = np.frombuffer(body, "<u8", 2 * count, _INDEX_HEAD if count else 0)
                    in_file = np.argsort(entries[1::2], kind="stable")
                    times.add(int.from_bytes(body[:2], "little"), entries[::2][in_file].tolist())
                    bare_chunk = False
                elif head.opcode == Opcode.MESSAGE and head.length >= MESSAGE_HEAD.size:
                    fields = MESSAGE_HEAD.unpack(source.peek(head.start, MESSAGE_HEAD.size))
                    times.add(fields[0], [fields[2]])
        except Exhausted:
            return None
    spans = times.spans()
    return [(info, spans[i]) for i, info in statistics.channels.items() if i in spans]


def spans_by_messages(path: Path, limits: Limits) -> list[tuple[ChannelInfo, Span]]:
    """Return the spans of the channels of a file by reading all of it.

    Raises:
        NotARecording: the file is empty, or is no MCAP.
    """
    file, times = McapFile(path, limits, lambda _: None), _Times()
    channels: dict[int, ChannelInfo] = {}
    for message in file.messages():
        channels[message.channel_id] = message.channel
        times.add(message.channel_id, [message.log_time_ns])
    spans = times.spans()
    return [(info, spans[i]) for i, info in channels.items()]
