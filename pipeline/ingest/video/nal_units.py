"""Units of H.264 and H.265 streams: start codes, lengths, and the fields that order pictures.

Sources: ITU-T H.264 (08/2021), 7.3.1 (units), 7.3.2.1.1 (sequence parameters), 7.3.3 (slice header),
D.1.8 (recovery point), annex B; ITU-T H.265 (08/2021), 7.3.1, 7.3.6.1, D.2.8; ISO/IEC 14496-15, 5.3.3 and
8.3.3 (configuration records and lengths of MP4).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

START = b"\0\0\0\1"
_RECOVERY_POINT = 6
_HIGH_PROFILES = (100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135)


class Bits:
    """Bits of a unit, without the bytes that only keep start codes apart.

    Raises:
        IndexError: there are no more.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data.replace(b"\0\0\3", b"\0\0")
        self._at = 0

    def bit(self) -> int:
        """Return the next bit."""
        value = self._data[self._at >> 3] >> (7 - (self._at & 7)) & 1
        self._at += 1
        return value

    def number(self, count: int) -> int:
        """Return the next `count` bits as a number."""
        value = 0
        for _ in range(count):
            value = value << 1 | self.bit()
        return value

    def ue(self) -> int:
        """Return a number in Exp-Golomb code, H.264 9.1."""
        zeros = 0
        while not self.bit():
            zeros += 1
            if zeros > 32:
                raise IndexError
        return (1 << zeros) - 1 + self.number(zeros)

    def se(self) -> int:
        """Return a number with a sign in Exp-Golomb code, H.264 9.1.1."""
        value = self.ue()
        return (value + 1) // 2 if value & 1 else -(value // 2)


class Sequence(NamedTuple):
    """Sequence parameters of H.264 that a slice header is read with."""

    frame_num_bits: int
    gaps_allowed: bool
    frames_only: bool
    separate_planes: bool


class Slice(NamedTuple):
    """Facts of a slice header of H.264."""

    frame_num: int
    is_intra: bool
    is_field: bool
    is_bottom: bool


def units_of(codec: str, data: bytes) -> list[bytes]:
    """Return the units of a packet without start codes, however they are framed."""
    if data[:3] == b"\0\0\1" or data[:4] == START:
        return list(_between_start_codes(data))
    found = _by_lengths(data)
    if found is None and data[:1] == b"\1":
        found = _of_configuration(codec, data)
    if found is None and b"\0\0\1" in data:
        found = list(_between_start_codes(data))
    return [data][: len(data)] if found is None else found


def _between_start_codes(data: bytes) -> Iterator[bytes]:
    at = data.find(b"\0\0\1")
    while at >= 0:
        following = data.find(b"\0\0\1", at + 3)
        unit = data[at + 3 : following if following >= 0 else len(data)].rstrip(b"\0")
        if unit:
            yield unit
        at = following


def _by_lengths(data: bytes) -> list[bytes] | None:
    """Return the units of a packet in which each has its length before it; None if it has not."""
    for size in (4, 2):
        found, at = [], 0
        while at + size < len(data):
            length = int.from_bytes(data[at : at + size], "big")
            unit = data[at + size : at + size + length]
            if length == 0 or len(unit) < length or unit[0] & 0x80:
                break
            found.append(unit)
            at += size + length
        if found and at == len(data):
            return found
    return None


def _of_configuration(codec: str, data: bytes) -> list[bytes] | None:
    """Return the parameter sets of a decoder configuration record (avcC, hvcC)."""
    found: list[bytes] = []
    try:
        at = 5 if codec == "h264" else 22
        if codec == "h264":
            counts = [data[at] & 0x1F]
        else:
            counts = [0] * data[at]
        at += 1
        for n in range(2 if codec == "h264" else len(counts)):
            if codec == "h264":
                count = counts[0] if n == 0 else data[at]
                at += 0 if n == 0 else 1
            else:
                count, at = int.from_bytes(data[at + 1 : at + 3], "big"), at + 3
            for _ in range(count):
                length = int.from_bytes(data[at : at + 2], "big")
                found.append(data[at + 2 : at + 2 + length])
                at += 2 + length
    except IndexError:
        return None
    return found if found and at <= len(data) and all(found) else None


def sequence_of(unit: bytes) -> Sequence | None:
    """Return sequence parameters of H.264; None if they cannot be read."""
    bits = Bits(unit[1:200])
    try:
        profile = bits.number(24) >> 16
        bits.ue()
        separate = False
        if profile in _HIGH_PROFILES:
            chroma = bits.ue()
            separate = chroma == 3 and bool(bits.bit())
            bits.ue(), bits.ue(), bits.bit()
            if bits.bit():
                for n in range(8 if chroma != 3 else 12):
                    if bits.bit():
                        _skip_scaling_list(bits, 16 if n < 6 else 64)
        frame_num_bits = bits.ue() + 4
        order = bits.ue()
        if order == 0:
            bits.ue()
        elif order == 1:
            bits.bit(), bits.se(), bits.se()
            for _ in range(min(bits.ue(), 255)):
                bits.se()
        bits.ue()
        gaps = bool(bits.bit())
        bits.ue(), bits.ue()
        return Sequence(frame_num_bits, gaps, bool(bits.bit()), separate)
    except IndexError:
        return None


def _skip_scaling_list(bits: Bits, size: int) -> None:
    last, following = 8, 8
    for _ in range(size):
        if following:
            following = (last + bits.se()) % 256
        last = following or last


def slice_of(unit: bytes, sequence: Sequence) -> Slice | None:
    """Return the facts of a slice of H.264; None if they cannot be read."""
    bits = Bits(unit[1:40])
    try:
        bits.ue()
        kind = bits.ue() % 5
        bits.ue()
        if sequence.separate_planes:
            bits.number(2)
        frame_num = bits.number(min(sequence.frame_num_bits, 16))
        is_field = not sequence.frames_only and bool(bits.bit())
        is_bottom = is_field and bool(bits.bit())
        return Slice(frame_num, kind in (2, 4), is_field, is_bottom)
    except IndexError:
        return None


def recovery_count(unit: bytes, head_bytes: int, *, signed: bool) -> int | None:
    """Return after how many pictures a stream is clean, by supplemental information; None: not told."""
    data = unit[head_bytes:].replace(b"\0\0\3", b"\0\0")
    at = 0
    while at + 2 < len(data):
        numbers = []
        for _ in range(2):
            value = 0
            while at < len(data) and data[at] == 0xFF:
                value, at = value + 255, at + 1
            value, at = value + (data[at] if at < len(data) else 0), at + 1
            numbers.append(value)
        kind, size = numbers
        if kind == _RECOVERY_POINT:
            bits = Bits(data[at : at + size])
            try:
                return max(bits.se() if signed else bits.ue(), 0)
            except IndexError:
                return None
        at += size
    return None
