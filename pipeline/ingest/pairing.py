"""Messages of one kind from one source, by time: the nearest to a frame, or the last one before."""

from __future__ import annotations

from bisect import bisect_right
from typing import Generic, NamedTuple, TypeVar

from pipeline.core.records import Pairing

T = TypeVar("T")


class Paired(NamedTuple, Generic[T]):
    """A value for a time: how it was chosen, and its time less the asked one."""

    value: T
    pairing: Pairing
    offset_ns: int


class Lane(Generic[T]):
    """Values sorted by time. Old ones are forgotten, but for the last before what is still asked.

    Where no frame asks, the oldest are forgotten too, so that no more than `limit` wait.
    """

    def __init__(
        self, topic: str, frame_id: str, *, by_capture_time: bool, limit: int = 100_000
    ) -> None:
        self.topic = topic
        self.frame_id = frame_id
        self.by_capture_time = by_capture_time
        self._limit = limit
        self._times: list[int] = []
        self._values: list[T] = []

    def add(self, time_ns: int, value: T) -> None:
        """Keep a value; times mostly rise, but need not."""
        at = bisect_right(self._times, time_ns)
        self._times.insert(at, time_ns)
        self._values.insert(at, value)
        if len(self._times) > self._limit:
            oldest = self._limit // 4 + 1  # many at once, so that it costs nothing a message
            del self._times[:oldest], self._values[:oldest]

    def nearest(self, time_ns: int, tolerance_ns: int) -> Paired[T] | None:
        """Return the value nearest in time, if it is within the tolerance."""
        after = bisect_right(self._times, time_ns)
        around = range(max(after - 1, 0), min(after + 1, len(self._times)))
        best = min(around, key=lambda i: abs(self._times[i] - time_ns), default=None)
        if best is None or abs(self._times[best] - time_ns) > tolerance_ns:
            return None
        return Paired(self._values[best], Pairing.NEAREST, self._times[best] - time_ns)

    def last_known(self, time_ns: int) -> Paired[T] | None:
        """Return the last value at or before a time."""
        before = bisect_right(self._times, time_ns) - 1
        if before < 0:
            return None
        offset_ns = self._times[before] - time_ns
        return Paired(self._values[before], Pairing.LAST_KNOWN, offset_ns)

    def take(self, time_ns: int, tolerance_ns: int) -> T | None:
        """Return and remove the value nearest in time: a set of boxes belongs to one frame."""
        found = self.nearest(time_ns, tolerance_ns)
        if found is None:
            return None
        at = bisect_right(self._times, time_ns + found.offset_ns) - 1
        del self._times[at], self._values[at]
        return found.value

    def forget_before(self, time_ns: int) -> None:
        """Drop what no frame from `time_ns` on can ask for."""
        keep_from = bisect_right(self._times, time_ns) - 1
        if keep_from > 64:  # seldom, so that dropping costs nothing a message
            del self._times[:keep_from], self._values[:keep_from]
