"""Search for the start of the next record, after bytes that are no record.

Nothing marks the start of an MCAP record, so a place is believed when a row of records follows from
it, each with a known opcode, a length that fits, and fields that fill that length; or when a chunk
starts there whose CRC fits.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mcap.opcode import Opcode

from pipeline.mcap_file.records import (
    FIRST_PRIVATE_OPCODE,
    FRAMING,
    KNOWN_OPCODES,
    MAGIC,
    MESSAGE_HEAD,
    Peek,
    content_length,
)
from pipeline.mcap_file.work import Work

_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)
_FIRST_BLOCK, _BLOCK = 1 << 12, 1 << 20
# Records in a row: two heads of nine bytes that fit by chance are not met in a terabyte.
_IN_A_ROW = 3
# Records of private opcodes between them, which prove nothing and contradict nothing.
_PRIVATE_IN_A_ROW = 16
# Bytes that a later version of the format may have put at the end of a record.
_PADDING = 4096


class RecordSearch:
    """Finds records in bytes that can be looked at anywhere.

    Args:
        peek: gives bytes from anywhere.
        size: how many there are.
        knows_channel: returns whether a channel is declared.
        work: bounds the places that are tried, over all searches of a file.
        is_whole_chunk: returns whether the CRC of a chunk fits, by the place of its record.
    """

    def __init__(
        self,
        peek: Peek,
        size: int,
        knows_channel: Callable[[int], bool],
        work: Work,
        is_whole_chunk: Callable[[int, int], bool] = lambda _offset, _length: False,
    ) -> None:
        self._peek = peek
        self._size = size
        self._knows_channel = knows_channel
        self._work = work
        self._is_whole_chunk = is_whole_chunk

    def next_record(self, start: int, in_chunk_to: int = 0) -> int | None:
        """Return where the next believable record starts, from `start` on.

        Args:
            start: first place that is tried.
            in_chunk_to: up to here the bytes may be those of a damaged chunk, whose records are not
                believed: only such as stand outside of chunks are looked for.
        """
        at, count = start, _FIRST_BLOCK
        while at + FRAMING.size <= self._size:
            block = self._peek(at, count + FRAMING.size - 1)
            if len(block) < FRAMING.size:
                return None
            for place in _possible_heads(block):
                if self._work.places_left <= 0:
                    return None
                self._work.places_left -= 1
                if at + place < in_chunk_to and block[place] in _IN_CHUNKS:
                    continue
                if self.starts_record(at + place):
                    return at + place
            at += len(block) - FRAMING.size + 1
            count = min(count * 4, _BLOCK)
        return None

    def starts_record(self, offset: int) -> bool:
        """Return whether a row of records starts here."""
        declared: set[int] = set()
        first, count, private = offset, 0, 0
        while count < _IN_A_ROW:
            if count and (offset == self._size or self._peek(offset, len(MAGIC)) == MAGIC):
                return True
            end = self._end_of_private(offset) if count and private < _PRIVATE_IN_A_ROW else None
            if end is not None:
                private += 1
                offset = end
                continue
            end = self._end_of_record(offset, declared)
            if end is None:
                # The last one may be cut off, if one before it was whole.
                return count > 0 and (self._is_cut(offset) or self._is_proven(first))
            count += 1
            offset = end
        return True

    def leads_on(self, offset: int) -> bool:
        """Return whether records go on here, or the file ends.

        Records of opcodes that are not known may come first.
        """
        for _ in range(_PRIVATE_IN_A_ROW):
            if offset >= self._size:
                return offset == self._size
            if self._peek(offset, len(MAGIC)) == MAGIC or self.starts_record(offset):
                return True
            head = self._peek(offset, FRAMING.size)
            if len(head) < FRAMING.size or head[0] in KNOWN_OPCODES or head[0] == 0:
                return False
            offset += FRAMING.size + int.from_bytes(head[1:], "little")
        return False

    def true_length(self, offset: int, opcode: int, length: int) -> int:
        """Return what a record's own fields say of its length, if only that leads on."""
        stated = content_length(opcode, offset, self._peek)
        after = offset + FRAMING.size
        if stated is None or stated == length or after + stated > self._size:
            return length
        if self.leads_on(after + length):
            return length
        proven = opcode == Opcode.CHUNK and self._is_whole_chunk(offset, stated)
        return stated if proven or self.leads_on(after + stated) else length

    def _is_proven(self, offset: int) -> bool:
        """Return whether the record here is a chunk whose CRC fits, whatever follows it."""
        opcode, length = FRAMING.unpack(self._peek(offset, FRAMING.size))
        return opcode == Opcode.CHUNK and self._is_whole_chunk(offset, length)

    def _end_of_private(self, offset: int) -> int | None:
        head = self._peek(offset, FRAMING.size)
        if len(head) < FRAMING.size or head[0] < FIRST_PRIVATE_OPCODE:
            return None
        end = offset + FRAMING.size + int.from_bytes(head[1:], "little")
        return end if end <= self._size else None

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


def _possible_heads(block: bytes) -> list[int]:
    """Return where a known opcode stands before a length below 4 GiB, whose upper half is zero."""
    values = np.frombuffer(block, np.uint8)
    zero = values == 0
    two = zero[:-1] & zero[1:]
    four = two[:-2] & two[2:]
    count = len(values) - (FRAMING.size - 1)
    opcodes = values[:count] - np.uint8(1) < max(KNOWN_OPCODES)  # 0 wraps round to 255
    return np.flatnonzero(four[FRAMING.size - 4 :] & opcodes).tolist()
