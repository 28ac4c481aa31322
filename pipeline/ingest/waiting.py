"""Pictures that wait for what belongs to them, still encoded, in the order of log times."""

from __future__ import annotations

import heapq
from bisect import insort
from collections.abc import Iterator
from dataclasses import dataclass, field

from pipeline.ingest.clocks import AROUND, SECOND_NS, Moment
from pipeline.messages.content import EncodedImage

MAX_WAITING = 256  # pictures, where log times make no sense; `Limits` bounds their bytes
# The first picture waits so long: by then it is known how the clocks run, and who brings boxes.
START_NS, START_BYTES = 5 * SECOND_NS, 64 * 1024**2
# Boxes that come later behind their pictures than this are not waited for.
LONGEST_NS = 5 * SECOND_NS

# Messages are in order but for less than this, unless a clock was set back and they are as in the file.
_SET_BACK_NS = SECOND_NS // 4


@dataclass(order=True, slots=True)
class Waiting:
    """A picture that waits; sorted by log time, and by the order in which they came."""

    log_time_ns: int
    order: int
    camera: str = field(compare=False)
    stamp_ns: int | None = field(compare=False)
    image: EncodedImage = field(compare=False)
    topic: str = field(compare=False)
    byte_offset: int = field(compare=False)
    capture_time_ns: int = field(compare=False, default=0)  # known when its turn comes

    @property
    def moment(self) -> Moment:
        """Its two times."""
        return Moment(self.log_time_ns, self.stamp_ns)


class WaitingRoom:
    """All pictures of a recording that wait.

    Args:
        look_ahead_ns: a picture waits until messages are so much later.
        most_bytes: of pictures that wait.
    """

    def __init__(self, look_ahead_ns: int, most_bytes: int) -> None:
        self._look_ahead_ns = look_ahead_ns
        self._most_bytes = most_bytes
        self._heap: list[Waiting] = []
        self._of_camera: dict[str, list[Waiting]] = {}
        self._bytes = 0
        self._order = 0
        self._started = False
        self._now_ns = 0

    def put(self, waiting: Waiting) -> None:
        """Let a picture wait; it is numbered in the order of its coming."""
        self._order += 1
        waiting.order = self._order
        self._bytes += len(waiting.image.data)
        heapq.heappush(self._heap, waiting)
        insort(self._of_camera.setdefault(waiting.camera, []), waiting)

    def wait_longer(self, delay_ns: int) -> None:
        """Wait from now on for what is logged so much later than its picture."""
        if self._look_ahead_ns < delay_ns <= LONGEST_NS:
            self._look_ahead_ns = min(delay_ns * 5 // 4, LONGEST_NS)

    def due(self, now_ns: int | None = None) -> Iterator[tuple[Waiting, list[Moment]]]:
        """Yield the pictures whose time has come, each with the next ones of its camera.

        Args:
            now_ns: the log time of the message that came last; None: there is no other.
        """
        if now_ns is not None and now_ns < self._now_ns - _SET_BACK_NS:
            yield from self._before(now_ns)
        self._now_ns = self._now_ns if now_ns is None else now_ns
        while self._heap and (now_ns is None or self._is_due(self._heap[0], now_ns)):
            yield self._next()

    def _before(self, now_ns: int) -> Iterator[tuple[Waiting, list[Moment]]]:
        """Yield all pictures but the one that came just now: the clock was set back."""
        newest = max(self._heap, key=lambda waiting: waiting.order, default=None)
        if newest is not None and newest.log_time_ns <= now_ns:
            self._heap.remove(newest)
            heapq.heapify(self._heap)
            self._of_camera[newest.camera].remove(newest)
        while self._heap:
            self._started = True
            yield self._next()
        if newest is not None and newest.log_time_ns <= now_ns:
            heapq.heappush(self._heap, newest)
            self._of_camera[newest.camera].append(newest)

    def _next(self) -> tuple[Waiting, list[Moment]]:
        waiting = heapq.heappop(self._heap)
        self._bytes -= len(waiting.image.data)
        others = self._of_camera[waiting.camera]
        others.remove(waiting)
        return waiting, [w.moment for w in others[:AROUND]]

    def _is_due(self, first: Waiting, now_ns: int) -> bool:
        if len(self._heap) > MAX_WAITING or self._bytes > self._most_bytes:
            return True
        if not self._started:
            waited = first.log_time_ns + START_NS < now_ns
            self._started = waited or self._bytes > min(START_BYTES, self._most_bytes)
            return False
        return first.log_time_ns + self._look_ahead_ns < now_ns
