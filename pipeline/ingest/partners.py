"""The values that belong to a picture, by the clock that picture and source share.

Most sources copy the stamp of the picture: that is sure. Where stamps differ, they are compared if both
are of one clock, else the log times are. A detector that states its own time is late by a constant
delay, which is found as the phase of its times between those of the pictures; whole times from picture to
picture cannot be told from it.
"""

from __future__ import annotations

import cmath
import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple

from pipeline.ingest.clocks import SECOND_NS, CameraClock, Moment
from pipeline.ingest.pairing import Lane, Paired

# Stamps that were written as decimal seconds or milliseconds are rounded.
EXACT_NS = 1_000_000
# Two stamps that are farther apart than this, while the log times are not, are of two clocks.
SHARED_NS = SECOND_NS
# An interval is halved for a tolerance up to this; who walked for longer is elsewhere.
LONGEST_TOLERANCE_NS = SECOND_NS
# Settings may be told once and hold on, but a clock that is wrong by a day must not bring them.
LAST_KNOWN_NS = 12 * 3600 * SECOND_NS
# A detector's answer cannot be logged before its picture, but for some jitter; as shares of an interval.
_EARLIEST = 0.1
AHEAD_NS = SECOND_NS // 4
_LOCKED = 0.8  # length of the mean phase (1: all alike) from which there is a constant delay
_FEWEST = 4


class Asked(NamedTuple):
    """A picture that asks for what belongs to it."""

    moment: Moment
    clock: CameraClock
    following: Moment | None  # the next picture of its camera


@dataclass(slots=True)
class Ways:
    """Counts of the ways in which values of a source were paired with a camera's pictures."""

    asked: int = 0
    exact: int = 0
    by_stamp: list[int] = field(default_factory=list)  # offsets, ns
    by_log: list[int] = field(default_factory=list)
    clock_offset_ns: int | None = None
    tolerance_ns: int = 0


class Partners:
    """Finds the values that belong to pictures; `tolerance_ns` is the least tolerance."""

    def __init__(self, tolerance_ns: int, kept_ns: int) -> None:
        self._tolerance_ns = tolerance_ns
        self._kept_ns = kept_ns
        self.ways: dict[tuple[int, str], Ways] = {}

    def find(self, lane: Lane[Any], asked: Asked) -> Paired[Any] | None:
        """Return the value nearest to a picture, or the last one before it."""
        tolerance_ns = self._half_interval(asked.clock)
        for by_stamp, time_ns in self._clocks(lane, asked):
            lane.forget_before(time_ns - self._kept_ns, by_stamp=by_stamp)
            found = lane.nearest(time_ns, tolerance_ns, by_stamp=by_stamp)
            found = found or lane.last_known(time_ns, by_stamp=by_stamp)
            if found is not None and -found.offset_ns <= LAST_KNOWN_NS:
                lane.asked += 1
                lane.offsets_ns.append(found.offset_ns)
                return found
        return None

    def take(
        self, lane: Lane[Any], asked: Asked, camera: str, *, is_caused: bool
    ) -> Paired[Any] | None:
        """Return and remove the value that belongs to a picture alone.

        Args:
            lane: the source.
            asked: the picture.
            camera: its name, under which the way is counted.
            is_caused: the value was made from the picture, so that it comes later.
        """
        ways = self.ways.setdefault((id(lane), camera), Ways())
        ways.asked += 1
        stamp_ns = asked.moment.stamp_ns
        if stamp_ns is not None and asked.clock.distinct and lane.distinct:
            close_ns = min(EXACT_NS, max(asked.clock.interval_ns // 4, 1))
            found = lane.take_stamp(stamp_ns, asked.moment.log_ns, close_ns)
            if found is not None:
                lane.exact += 1
                ways.exact += 1
                lane.forget_before(stamp_ns - self._kept_ns, by_stamp=True)
                return found
        copies = lane.exact >= _FEWEST and lane.exact * 2 > lane.taken
        for by_stamp, time_ns in self._clocks(lane, asked):
            # Who copies stamps does so always; log times are late also then, where stamps fail.
            exact = copies and by_stamp
            ways.tolerance_ns = self._tolerance_ns if exact else self._half_interval(asked.clock)
            lag_ns = constant_lag_ns(lane, asked.clock, by_stamp) if is_caused and not exact else 0
            if self._is_nearer_to_next(lane, asked, by_stamp, time_ns + lag_ns, lag_ns):
                continue
            found = lane.take(time_ns + lag_ns, ways.tolerance_ns, by_stamp=by_stamp)
            if found is not None:
                offset_ns = found.offset_ns + lag_ns
                (ways.by_stamp if by_stamp else ways.by_log).append(offset_ns)
                lane.forget_before(time_ns - self._kept_ns, by_stamp=by_stamp)
                ways.clock_offset_ns = _clock_offset(lane, asked.clock)
                return found._replace(offset_ns=offset_ns)
        return None

    def _half_interval(self, clock: CameraClock) -> int:
        half_ns = min(clock.interval_ns // 2, LONGEST_TOLERANCE_NS)
        return max(self._tolerance_ns, half_ns)

    def _clocks(self, lane: Lane[Any], asked: Asked) -> Iterator[tuple[bool, int]]:
        """Yield the clocks on which a lane and a picture can meet, and the picture's time on each."""
        stamp_ns, log_ns = asked.moment.stamp_ns, asked.moment.log_ns
        offset_ns = _clock_offset(lane, asked.clock)
        usable = stamp_ns is not None and offset_ns is not None and asked.clock.trusts(asked.moment)
        usable = usable and lane.distinct
        # Stamps that are ahead of their logging, more than those of pictures are, are of another clock.
        if usable and -SHARED_NS <= (offset_ns or 0) <= AHEAD_NS:
            yield True, stamp_ns or 0
            return
        yield False, log_ns
        if usable:
            yield True, stamp_ns or 0

    def _is_nearer_to_next(
        self, lane: Lane[Any], asked: Asked, by_stamp: bool, time_ns: int, lag_ns: int
    ) -> bool:
        following = asked.following
        if following is None:
            return False
        next_ns = following.stamp_ns if by_stamp else following.log_ns
        found = lane.nearest(time_ns, LONGEST_TOLERANCE_NS, by_stamp=by_stamp)
        if next_ns is None or found is None:
            return False
        at_ns = time_ns + found.offset_ns
        return abs(at_ns - next_ns - lag_ns) < abs(found.offset_ns)


def _clock_offset(lane: Lane[Any], clock: CameraClock) -> int | None:
    """Return how far the stamps of a source are ahead of a camera's, as the log times show them."""
    own_ns, camera_ns = lane.delays.usual_ns, clock.delays.usual_ns
    return None if own_ns is None or camera_ns is None else own_ns - camera_ns


def constant_lag_ns(lane: Lane[Any], clock: CameraClock, by_stamp: bool) -> int:
    """Return by how much a source's times lag behind the pictures', if it is always the same, else 0.

    The phase of each value between two pictures is an angle; their mean direction is the lag, and the
    length of their mean tells how alike they are (Mardia and Jupp 2000, Directional Statistics, 2.3).
    """
    times = [(m.stamp_ns if by_stamp else m.log_ns) for m in clock.seen]
    pictures = sorted(t for t in times if t is not None)
    if len(pictures) < _FEWEST:
        return 0
    interval_ns = median(b - a for a, b in pairwise(pictures))
    values = [stamp_ns if by_stamp else log_ns for log_ns, stamp_ns in lane.recent]
    within = [v for v in values if v is not None and pictures[0] <= v <= pictures[-1] + interval_ns]
    if len(within) < _FEWEST or interval_ns <= 0:
        return 0
    turns = [(v - pictures[bisect_right(pictures, v) - 1]) / interval_ns for v in within]
    mean = sum(cmath.exp(2j * math.pi * turn) for turn in turns) / len(turns)
    if abs(mean) < _LOCKED:
        return 0
    share = cmath.phase(mean) / (2 * math.pi)  # from -0.5 to 0.5
    return round((share if share >= -_EARLIEST else share + 1) * interval_ns)
