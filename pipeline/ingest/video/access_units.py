"""Pictures of a video stream from messages that hold less than one of them, or more.

Parameter sets may come in messages of their own, each slice in one, or two pictures in one. A decoder
gets one whole picture at a time, with the parameter sets before it. Where the numbers of pictures
(`frame_num` of H.264, 7.4.3) leave one out, a packet was lost.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

from pipeline.ingest.video.nal_units import (
    START,
    Sequence,
    Slice,
    recovery_count,
    sequence_of,
    slice_of,
    units_of,
)

Item = TypeVar("Item")

FRAMED = ("h264", "hevc")  # codecs that are made of such units
_MOST_BYTES = 64 * 1024**2  # of one picture
_H264_IDR, _H264_SEI, _H264_SPS = 5, 6, 7
_H264_PICTURE = (1, 2, 5)
_HEVC_IRAP = range(16, 24)
_HEVC_SEI = 39
_HEVC_LAST_PICTURE = 31


class Times(NamedTuple):
    """Times of a packet: of its logging, and of its capture as it states it."""

    log_time_ns: int
    capture_time_ns: int | None


@dataclass(slots=True)
class AccessUnit(Generic[Item]):
    """One picture of a stream, encoded."""

    item: Item
    times: Times
    data: bytes = b""
    recovers_after: int | None = (
        None  # decoding can begin here, and is clean after so many pictures
    )
    gap: str = ""  # lost before it, if anything was
    pictures: int = 0  # parts of the picture that begin one: 2 of fields
    only_intra: bool = True
    has_slice: bool = False


class AccessUnits(Generic[Item]):
    """Gathers the pictures of one stream of H.264 or H.265."""

    def __init__(self, codec: str) -> None:
        self._codec = codec
        self._head = b""  # parameter sets that wait for their picture
        self._head_recovers: int | None = None
        self._pending: AccessUnit[Item] | None = None
        self._sequence: Sequence | None = None
        self._last: int | None = None  # frame_num of the last picture that others refer to
        self._first: Slice | None = None  # of the pending picture
        self._gap = ""
        self._told_recovery = False
        self._last_log_ns: int | None = None

    def lose(self, reason: str) -> Iterator[AccessUnit[Item]]:
        """Say that something was lost here; yield the picture before it."""
        yield from self.flush()
        self._gap, self._last = reason, None

    def take(self, data: bytes, item: Item, times: Times) -> Iterator[AccessUnit[Item]]:
        """Yield the pictures that are complete with a message."""
        begun, known = 0, False
        for unit in units_of(self._codec, data):
            kind = self._kind(unit)
            known = known or self._is_known(kind)
            if not self._is_picture(kind):
                if self._pending is not None and self._pending.has_slice:
                    yield from self.flush()
                self._keep(kind, unit)
                continue
            if self._begins(kind, unit):
                yield from self.flush()
                self._pending = AccessUnit(item, self._time_of(begun, times))
                begun += 1
            self._add(kind, unit, item, times)
        if begun:
            self._last_log_ns = times.log_time_ns
        if not known:
            yield from self.lose("a message before it holds nothing of a stream")
            yield AccessUnit(item, times)

    def flush(self) -> Iterator[AccessUnit[Item]]:
        """Yield the picture that is not known to be complete."""
        pending, self._pending, self._first = self._pending, None, None
        if pending is None or not pending.has_slice:
            return
        if (
            self._codec == "h264"
            and pending.recovers_after is None
            and pending.only_intra
            and not self._told_recovery
        ):
            pending.recovers_after = (
                0  # all of it is intra, and the stream never says where it recovers
            )
        yield pending

    def _kind(self, unit: bytes) -> int:
        return unit[0] & 0x1F if self._codec == "h264" else unit[0] >> 1 & 0x3F

    def _is_picture(self, kind: int) -> bool:
        return kind in _H264_PICTURE if self._codec == "h264" else kind <= _HEVC_LAST_PICTURE

    def _is_known(self, kind: int) -> bool:
        """Return whether a unit is a picture's, or parameters, information, or an end."""
        return 1 <= kind <= 12 if self._codec == "h264" else kind <= 40

    def _keep(self, kind: int, unit: bytes) -> None:
        """Keep parameter sets and what else goes before a picture."""
        is_avc = self._codec == "h264"
        if len(self._head) + len(unit) > _MOST_BYTES:
            self._head = b""
        self._head += START + unit
        if is_avc and kind == _H264_SPS:
            self._sequence = sequence_of(unit) or self._sequence
        elif kind == (_H264_SEI if is_avc else _HEVC_SEI):
            count = recovery_count(unit, 1 if is_avc else 2, signed=not is_avc)
            if count is not None:
                self._head_recovers, self._told_recovery = count, True

    def _begins(self, kind: int, unit: bytes) -> bool:
        """Return whether a slice is the first one of a picture."""
        if self._pending is None or self._head:
            return True
        if len(self._pending.data) > _MOST_BYTES:
            return True
        at = 1 if self._codec == "h264" else 2
        if len(unit) <= at or not unit[at] & 0x80:  # first_mb_in_slice or first_slice_segment
            return False
        return not self._is_second_field(unit)

    def _is_second_field(self, unit: bytes) -> bool:
        first = self._first
        if first is None or not first.is_field or self._sequence is None:
            return False
        second = slice_of(unit, self._sequence)
        return (
            second is not None
            and second.is_field
            and second.frame_num == first.frame_num
            and second.is_bottom != first.is_bottom
            and self._pending is not None
            and self._pending.pictures < 2
        )

    def _add(self, kind: int, unit: bytes, item: Item, times: Times) -> None:
        if self._pending is None:
            self._pending = AccessUnit(item, times)
        pending = self._pending
        at = 1 if self._codec == "h264" else 2
        if len(unit) > at and unit[at] & 0x80:
            pending.pictures += 1
        if not pending.has_slice:
            self._open(pending, kind, unit)
        elif self._codec == "h264" and self._sequence is not None:
            found = slice_of(unit, self._sequence)
            pending.only_intra = pending.only_intra and found is not None and found.is_intra
        pending.data += self._head + START + unit
        self._head = b""

    def _open(self, pending: AccessUnit[Item], kind: int, unit: bytes) -> None:
        """Learn from the first slice of a picture."""
        pending.has_slice = True
        pending.gap, self._gap = self._gap, ""
        pending.recovers_after, self._head_recovers = self._head_recovers, None
        if self._codec == "hevc":
            pending.only_intra = False
            if kind in _HEVC_IRAP:
                pending.recovers_after = 0
            return
        is_idr = kind == _H264_IDR
        found = None if self._sequence is None else slice_of(unit, self._sequence)
        self._first = found
        pending.only_intra = found is not None and found.is_intra
        if is_idr:
            pending.recovers_after = 0
        if found is None:
            return
        pending.gap = pending.gap or self._missing(found.frame_num, is_idr)
        if unit[0] >> 5 & 3:  # others refer to it
            self._last = found.frame_num

    def _missing(self, frame_num: int, is_idr: bool) -> str:
        """Return a sentence if `frame_num` shows that a picture before it is missing."""
        if is_idr or self._last is None or self._sequence is None or self._sequence.gaps_allowed:
            return ""
        before = self._last
        following = (before + 1) % (1 << self._sequence.frame_num_bits)
        if frame_num in (before, following):  # the former: the second field of it
            return ""
        return "packets before it are missing, by the numbers in the stream"

    def _time_of(self, begun: int, times: Times) -> Times:
        """Return the times of the second picture of a message, between this one and the next."""
        if begun == 0 or self._last_log_ns is None:
            return Times(times.log_time_ns + begun, _later(times.capture_time_ns, begun))
        step_ns = max(times.log_time_ns - self._last_log_ns, 2) // 2 * begun
        return Times(times.log_time_ns + step_ns, _later(times.capture_time_ns, step_ns))


def _later(time_ns: int | None, step_ns: int) -> int | None:
    return None if time_ns is None else time_ns + step_ns
