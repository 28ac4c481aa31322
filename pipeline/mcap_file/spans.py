"""Log times of each channel's messages, by the message indexes of a file or by a look at its messages."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.mcap_file.channels import ChannelInfo
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.reader import McapFile
from pipeline.mcap_file.records import MAGIC, MESSAGE_HEAD
from pipeline.mcap_file.rescue import record_heads
from pipeline.mcap_file.search import RecordSearch
from pipeline.mcap_file.summary import statistics_of
from pipeline.mcap_file.work import Exhausted, Work

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
        work = Work(limits, source.size)
        search = RecordSearch(source.peek, source.size, lambda _: True, work)
        try:
            for head in record_heads(source, len(MAGIC), search, work):
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
