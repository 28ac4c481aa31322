"""Checks at the ends of a recording: its CRCs, its counts, its footer, and what follows it."""

from __future__ import annotations

import zlib

from mcap.opcode import Opcode

from pipeline.core.records import Severity
from pipeline.mcap_file.reading import Reading
from pipeline.mcap_file.records import FRAMING, MAGIC, Malformed, read_data_crc, read_footer


def check_counts(reading: Reading) -> None:
    """Hold what was read against what the summary counted."""
    losses, first_id = reading.losses, reading.topics.first_id
    losses.end_of_indexes(first_id)
    losses.close_gap(None)
    for stated_id, stated in reading.stated_counts.items():
        channel_id = stated_id + first_id
        known = reading.message_counts[channel_id] + reading.repeated_counts[channel_id]
        missing = stated - known - losses.messages[channel_id]
        # A count that no file can hold is not believed.
        if 0 < missing <= reading.source.size:
            losses.lose(channel_id, missing, "messages that the summary counts were not found")
    reading.stated_counts = {}


def check_data_end(reading: Reading, body: bytes | memoryview, offset: int, crc: int) -> None:
    """Check the CRC of the data section, and begin that of the summary.

    Raises:
        Malformed: the record holds none.
    """
    expected = read_data_crc(body)
    if expected and reading.crc_holds and expected != crc:
        reading.losses.damage(
            "data_crc",
            "the CRC of the data section does not fit: bytes outside the chunks' own CRCs, "
            "or inside a chunk reported above, were changed",
            offset,
        )
    reading.crc_holds = True
    reading.source.restart_crc()


def is_end(reading: Reading, body: bytes | memoryview, offset: int, crc: int) -> bool:
    """Check the footer and the magic behind it; a footer in the middle is none."""
    source, losses = reading.source, reading.losses
    after = source.peek(source.position, len(MAGIC))
    if (
        after != MAGIC
        and reading.search.leads_on(source.position)
        and source.position < source.size
    ):
        losses.damage("damaged_record", "a footer in the middle was passed over", offset)
        return False
    try:
        expected = read_footer(body).summary_crc
    except Malformed as error:
        losses.damaged_record(Opcode.FOOTER, offset, error)
        return True
    inside = FRAMING.pack(Opcode.FOOTER, len(body)) + bytes(body[:16])
    if expected and reading.crc_holds and expected != zlib.crc32(inside, crc):
        losses.damage(
            "summary_crc",
            "the CRC of the summary does not fit; no frame comes from there, what the summary "
            "repeats was taken from the records",
            offset,
        )
    if source.read(len(MAGIC)) != MAGIC:
        losses.damage("truncated_file", "the magic bytes at the end are missing", offset)
    return True


def another_follows(reading: Reading) -> bool:
    """Return whether another recording, or a lost part of this one, follows behind the end."""
    source, losses = reading.source, reading.losses
    start = source.position
    if start >= source.size:
        return False
    if source.peek(start, len(MAGIC)) == MAGIC:
        source.skip_to(start + len(MAGIC))
        text = "another recording follows in the same file; it was read too"
        if not source.is_joined:
            losses.tell(Severity.INFO, "another_recording", text, start)
    else:
        resume = reading.search.next_record(start)
        losses.damage(
            "bytes_after_end",
            f"{(resume or source.size) - start:,} bytes behind the end are no record",
            start,
            losses.newest_ns,
        )
        if resume is None:
            return False
        source.skip_to(resume)
    reading.begin = source.position
    reading.topics.begin_another()
    reading.crc_holds = False  # it starts with the magic, which may be gone
    return True
