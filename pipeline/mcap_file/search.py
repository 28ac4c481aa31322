"""Search for the start of the next record, after bytes that are no record.

Nothing marks the start of an MCAP record, so a place is believed when a row of records follows from
it, each with a known opcode, a length that fits, and fields that fill that length.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from mcap.opcode import Opcode

from pipeline.mcap_file.records import (
    FRAMING,
    KNOWN_OPCODES,
    MAGIC,
    MESSAGE_HEAD,
    Peek,
    content_length,
)

# An opcode, and a length below 4 GiB: its upper half is zero, which random bytes are not.
_HEAD = re.compile(rb"(?=([\x01-\x0f])[\s\S]{4}\x00\x00\x00\x00)")
_BLOCK = 1 << 20
# Records in a row: two heads of nine bytes that fit by chance are not met in a terabyte.
_IN_A_ROW = 3
# Bytes that a later version of the format may have put at the end of a record.
_PADDING = 4096


class RecordSearch:
    """Finds records in bytes that can be looked at anywhere."""

    def __init__(
        self, peek: Peek, size: int, knows_channel: Callable[[int], bool], budget: int
    ) -> None:
        """Look through `peek`; `budget` bounds the places that are tried, over all searches."""
        self._peek = peek
        self._size = size
        self._knows_channel = knows_channel
        self.budget = budget

    def next_record(self, start: int) -> int | None:
        """Return where the next believable record starts, from `start` on."""
        at = start
        while at + FRAMING.size <= self._size:
            block = self._peek(at, _BLOCK + FRAMING.size - 1)
            for match in _HEAD.finditer(block):
                if self.budget <= 0:
                    return None
                self.budget -= 1
                if self.starts_record(at + match.start()):
                    return at + match.start()
            if len(block) < FRAMING.size:
                return None
            at += len(block) - FRAMING.size + 1
        return None

    def starts_record(self, offset: int) -> bool:
        """Return whether a row of records starts here."""
        declared: set[int] = set()
        for count in range(_IN_A_ROW):
            if count and (offset == self._size or self._peek(offset, len(MAGIC)) == MAGIC):
                return True
            end = self._end_of_record(offset, declared)
            if end is None:
                # The last one may be cut off, if one before it was whole.
                return count > 0 and self._is_cut(offset)
            offset = end
        return True

    def leads_on(self, offset: int) -> bool:
        """Return whether records go on here, or the file ends."""
        if offset >= self._size:
            return offset == self._size
        return self._peek(offset, len(MAGIC)) == MAGIC or self.starts_record(offset)

    def true_length(self, offset: int, opcode: int, length: int) -> int:
        """Return what a record's own fields say of its length, if only that leads on."""
        stated = content_length(opcode, offset, self._peek)
        after = offset + FRAMING.size
        if stated is None or stated == length or after + stated > self._size:
            return length
        return (
            stated
            if not self.leads_on(after + length) and self.leads_on(after + stated)
            else length
        )

    def _is_cut(self, offset: int) -> bool:
        head = self._peek(offset, FRAMING.size)
        if len(head) < FRAMING.size:
            return True
        opcode, length = FRAMING.unpack(head)
        return opcode in KNOWN_OPCODES and length < 1 << 40 and offset + length > self._size

    def _end_of_record(self, offset: int, declared: set[int]) -> int | None:
        head = self._peek(offset, FRAMING.size)
        if len(head) < FRAMING.size:
            return None
        opcode, length = FRAMING.unpack(head)
        end = offset + FRAMING.size + length
        if opcode not in KNOWN_OPCODES or end > self._size:
            return None
        if opcode == Opcode.MESSAGE:
            channel_id = int.from_bytes(self._peek(offset + FRAMING.size, 2), "little")
            known = channel_id in declared or self._knows_channel(channel_id)
            return end if length >= MESSAGE_HEAD.size and known else None
        stated = content_length(opcode, offset, self._peek)
        if stated is None or not stated <= length <= stated + _PADDING:
            return None
        if opcode == Opcode.CHANNEL:
            declared.add(int.from_bytes(self._peek(offset + FRAMING.size, 2), "little"))
        if opcode == Opcode.FOOTER and self._peek(end, len(MAGIC)) != MAGIC:
            return None
        return end
