"""Values that were logged long after their pictures: boxes appended to a recording, for one.

Such values have the stamps of their pictures, but come when these are gone. They are read first.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from pipeline.core.config import Limits
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


def topics_logged_behind(path: Path, limits: Limits, *, look_again: bool) -> set[str]:
    """Return the topics whose messages are logged too long after the pictures to be waited for.

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
        return set()
    first_ns = min(span.first_ns for span in pictures)
    median_ns = max(span.median_ns for span in pictures)
    return {
        info.topic
        for info, span in spans
        if kind_of(info) in _OF_A_MOMENT
        and span.first_ns > first_ns + LONGEST_NS
        and span.median_ns > median_ns + LONGEST_NS
    }


def messages_of(path: Path, limits: Limits, topics: set[str]) -> Iterator[RawMessage]:
    """Yield the messages of topics; what is damaged is told by who reads the rest."""
    for raw in McapFile(path, limits, lambda _: None).messages():
        if raw.channel.topic in topics:
            yield raw


_INDEX_HEAD = 6  # channel id and length of the array
_MOST = 100_000  # times of one channel that are kept; then every second one


class Span(NamedTuple):
    """Log times of the messages of a channel: of the earliest, and their median."""

    first_ns: int
    median_ns: int


class _Times:
    def __init__(self) -> None:
        self._times: dict[int, list[int]] = defaultdict(list)
        self._first: dict[int, int] = {}

    def add(self, channel_id: int, times_ns: list[int]) -> None:
        if not times_ns:
            return
        first_ns = min(times_ns)
        self._first[channel_id] = min(self._first.get(channel_id, first_ns), first_ns)
        kept = self._times[channel_id]
        kept.extend(times_ns)
        if len(kept) > _MOST:
            del kept[::2]

    def spans(self) -> dict[int, Span]:
        return {
            channel_id: Span(self._first[channel_id], int(np.median(np.array(times, np.float64))))
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
                    times.add(int.from_bytes(body[:2], "little"), entries[::2].tolist())
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
