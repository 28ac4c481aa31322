"""The summary at the end of a file: what it repeats and counts, if its CRC fits."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mcap.opcode import Opcode

from pipeline.core.config import Limits
from pipeline.mcap_file.channels import ChannelInfo, Topics
from pipeline.mcap_file.forward_file import ForwardFile
from pipeline.mcap_file.records import (
    FRAMING,
    MAGIC,
    Malformed,
    read_footer,
    read_statistics,
    read_time_range,
)

_FOOTER_BODY = 20
_FOOTER_REACH = 4096  # a later version of the format may have made it longer


class Statistics(NamedTuple):
    """Statistics of the whole file, from the summary at its end."""

    channels: dict[int, ChannelInfo]
    message_counts: dict[int, int]
    start_ns: int
    end_ns: int


def statistics_of(path: Path, limits: Limits) -> Statistics | None:
    """Return what the summary says without reading the rest; None if it is not there or damaged."""
    topics = Topics(limits, lambda *_: None)
    with ForwardFile(path) as source:
        found = list(summary_records(source, limits.record_bytes))
    topics.add_declarations(found, None)
    bodies = [body for opcode, body in found if opcode == Opcode.STATISTICS]
    if not bodies:
        return None
    try:
        counts = read_statistics(bodies[0])
        start_ns, end_ns = read_time_range(bodies[0])
    except Malformed:
        return None
    return Statistics(topics.channels, counts, start_ns, end_ns)


def summary_records(
    source: ForwardFile, limit: int, *, proven: bool = False
) -> Iterator[tuple[int, bytes]]:
    """Yield schemas, channels and statistics of the summary, if it is there and its CRC fits.

    Args:
        source: the file.
        limit: bytes that the summary may have.
        proven: yield nothing from a summary without a CRC.
    """
    found = _footer(source)
    if found is None:
        return
    end, head = found
    footer = read_footer(head[FRAMING.size :])
    start, size = footer.summary_start, end - footer.summary_start
    if start == 0 or not 0 < size <= limit:
        return
    summary = source.peek(start, size)
    stated = zlib.crc32(head[: FRAMING.size + 16], zlib.crc32(summary))
    if (proven or footer.summary_crc) and stated != footer.summary_crc:
        return
    position = 0
    while position + FRAMING.size <= size:
        opcode, length = FRAMING.unpack_from(summary, position)
        position += FRAMING.size
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS):
            yield opcode, summary[position : position + length]
        position += length


def _footer(source: ForwardFile) -> tuple[int, bytes] | None:
    """Return where the footer at the end of the file starts, and its bytes."""
    start = max(source.size - _FOOTER_REACH, 0)
    tail = source.peek(start, _FOOTER_REACH).removesuffix(MAGIC)
    at = len(tail)
    while (at := tail.rfind(bytes([Opcode.FOOTER]), 0, at)) >= 0:
        body = len(tail) - at - FRAMING.size
        if body >= _FOOTER_BODY and FRAMING.unpack_from(tail, at)[1] == body:
            return start + at, tail[at:]
    return None
