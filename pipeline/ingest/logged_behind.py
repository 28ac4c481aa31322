"""Values that were logged long after their pictures: boxes appended to a recording, for one.

Such values have the stamps of their pictures, but come when these are gone. They are read first.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pipeline.core.config import Limits
from pipeline.ingest.waiting import LONGEST_NS
from pipeline.mcap_file.reader import McapFile, RawMessage
from pipeline.mcap_file.spans import spans_by_index, spans_by_messages
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
