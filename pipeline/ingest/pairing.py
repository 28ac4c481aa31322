"""Messages of one kind from one source, by time: the nearest to a frame, or the last one before.

A message has the time of its logging and often a stamp of its own; each is a clock of its own. The
values of a lane are found by either.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from typing import Generic, NamedTuple, TypeVar

from pipeline.core.records import Pairing
from pipeline.ingest.clocks import Delays

T = TypeVar("T")

FEWEST, DISTINCT = 4, 0.7
RECENT = 33  # messages that tell how a source's clock runs
_SECOND_NS = 1_000_000_000
_KEPT_BEHIND = 64  # values that stay behind the one that was asked for


class Paired(NamedTuple, Generic[T]):
    """A value for a time: how it was chosen, and its time less the asked one."""

    value: T
    pairing: Pairing
    offset_ns: int


class _Sorted:
    """Numbers of values by their time on one clock."""

    def __init__(self) -> None:
        self.times: list[int] = []
        self.numbers: list[int] = []

    def add(self, time_ns: int, number: int) -> None:
        at = bisect_right(self.times, time_ns)
        self.times.insert(at, time_ns)
        self.numbers.insert(at, number)

    def nearest(self, time_ns: int) -> int | None:
        """Return the place of the value nearest in time."""
        after = bisect_right(self.times, time_ns)
        around = range(max(after - 1, 0), min(after + 1, len(self.times)))
        return min(around, key=lambda i: abs(self.times[i] - time_ns), default=None)

    def remove(self, time_ns: int, number: int) -> None:
        at = bisect_left(self.times, time_ns)
        while self.numbers[at] != number:
            at += 1
        del self.times[at], self.numbers[at]


class Lane(Generic[T]):
    """Values of one source by log time and by stamp; the oldest are forgotten beyond `limit`."""

    def __init__(self, topic: str, frame_id: str, *, limit: int = 100_000) -> None:
        self.topic = topic
        self.frame_id = frame_id
        self.added = 0
        self.taken = 0
        self.asked = 0  # by pictures that take settings from it
        self.offsets_ns: deque[int] = deque(maxlen=RECENT)  # of settings from their pictures
        self.exact = 0  # how often a picture had the very stamp of a value
        self.delays = Delays(RECENT)
        self.recent: deque[tuple[int, int | None]] = deque(maxlen=RECENT)
        self._limit = limit
        self._logs, self._stamps = _Sorted(), _Sorted()
        self._values: dict[int, tuple[int, int | None, T]] = {}

    def __len__(self) -> int:
        return len(self._values)

    @property
    def distinct(self) -> bool:
        """True if stamps tell the last values apart: those of whole seconds do not."""
        stamps = [stamp_ns for _, stamp_ns in self.recent if stamp_ns is not None]
        return len(stamps) < FEWEST or len(set(stamps)) > DISTINCT * len(stamps)

    def add(self, log_time_ns: int, stamp_ns: int | None, value: T) -> None:
        """Keep a value; times mostly rise, but need not."""
        number = self.added
        self.added += 1
        self._values[number] = log_time_ns, stamp_ns, value
        self._logs.add(log_time_ns, number)
        if stamp_ns is not None:
            self._stamps.add(stamp_ns, number)
            self.delays.add(stamp_ns - log_time_ns)
        self.recent.append((log_time_ns, stamp_ns))
        if len(self._values) > self._limit:  # many at once, so that it costs nothing a message
            self._forget(self._logs.numbers[: self._limit // 4 + 1])

    def nearest(
        self, time_ns: int, tolerance_ns: int, *, by_stamp: bool = False
    ) -> Paired[T] | None:
        """Return the value nearest in time on one of the clocks, if it is within the tolerance."""
        clock = self._stamps if by_stamp else self._logs
        best = clock.nearest(time_ns)
        if best is None or abs(clock.times[best] - time_ns) > tolerance_ns:
            return None
        return self._paired(clock, best, time_ns, Pairing.NEAREST)

    def last_known(self, time_ns: int, *, by_stamp: bool = False) -> Paired[T] | None:
        """Return the last value at or before a time on one of the clocks."""
        clock = self._stamps if by_stamp else self._logs
        before = bisect_right(clock.times, time_ns) - 1
        return None if before < 0 else self._paired(clock, before, time_ns, Pairing.LAST_KNOWN)

    def take(self, time_ns: int, tolerance_ns: int, *, by_stamp: bool = False) -> Paired[T] | None:
        """Return and remove the value nearest in time: a set of boxes belongs to one frame."""
        clock = self._stamps if by_stamp else self._logs
        return self._taken(clock, clock.nearest(time_ns), time_ns, tolerance_ns)

    def take_stamp(self, stamp_ns: int, log_time_ns: int, tolerance_ns: int) -> Paired[T] | None:
        """Return and remove the value of a stamp; of several, the one logged nearest to a time.

        Stamps come twice where a clock was set back.
        """
        clock = self._stamps
        low = bisect_left(clock.times, stamp_ns - tolerance_ns)
        high = bisect_right(clock.times, stamp_ns + tolerance_ns)

        def far(at: int) -> tuple[int, int]:
            log_ns, _, _ = self._values[clock.numbers[at]]
            second = abs(log_ns - log_time_ns) // _SECOND_NS
            return second, abs(clock.times[at] - stamp_ns)

        best = min(range(low, high), key=far, default=None)
        return self._taken(clock, best, stamp_ns, tolerance_ns)

    def _taken(
        self, clock: _Sorted, at: int | None, time_ns: int, tolerance_ns: int
    ) -> Paired[T] | None:
        if at is None or abs(clock.times[at] - time_ns) > tolerance_ns:
            return None
        found = self._paired(clock, at, time_ns, Pairing.NEAREST)
        self.taken += 1
        self._forget([clock.numbers[at]])
        return found

    def forget_before(self, time_ns: int, *, by_stamp: bool = False) -> None:
        """Drop what no frame from `time_ns` on can ask for on one of the clocks."""
        clock = self._stamps if by_stamp else self._logs
        keep_from = bisect_right(clock.times, time_ns) - 1 - _KEPT_BEHIND
        if keep_from > _KEPT_BEHIND:  # seldom, so that dropping costs nothing a message
            self._forget(clock.numbers[:keep_from])

    def _paired(self, clock: _Sorted, at: int, time_ns: int, pairing: Pairing) -> Paired[T]:
        _, _, value = self._values[clock.numbers[at]]
        return Paired(value, pairing, clock.times[at] - time_ns)

    def _forget(self, numbers: list[int]) -> None:
        if len(numbers) == 1:
            log_ns, stamp_ns, _ = self._values.pop(numbers[0])
            self._logs.remove(log_ns, numbers[0])
            if stamp_ns is not None:
                self._stamps.remove(stamp_ns, numbers[0])
            return
        gone = set(numbers)
        for number in gone:
            del self._values[number]
        for clock in (self._logs, self._stamps):
            kept = [
                (t, n) for t, n in zip(clock.times, clock.numbers, strict=True) if n not in gone
            ]
            clock.times, clock.numbers = [t for t, _ in kept], [n for _, n in kept]
