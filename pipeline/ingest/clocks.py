"""Times at which a camera's pictures were taken, read from clocks that may be wrong.

A picture has two times: of its logging, and mostly a stamp of its own. A stamp is used if the stamps of
the pictures around it rise as a clock does; a single one that is far off is replaced by the log time
and the usual delay; and where the clock was set, times go on as the other clock tells. The log times
are those by which messages are sorted, so they never fall.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import median
from typing import NamedTuple

# Between two frames the way from the sensor into the log changes by less, if no clock is set.
CLOCK_STEP_NS = 500_000_000
# Pictures before and behind one that tell how its camera's clocks run.
AROUND = 8
SECOND_NS, MS_NS = 1_000_000_000, 1_000_000
# The years 2000 to 2100: times in seconds, milliseconds or microseconds of these years are told by it.
_MODERN_NS = (946_684_800 * SECOND_NS, 4_102_444_800 * SECOND_NS)
_UNITS = {10**3: "microseconds", 10**6: "milliseconds", 10**9: "seconds"}
# A camera of more than a thousand pictures a second is not a camera that watches people.
_SHORTEST_NS = MS_NS
_RATIO = 10  # of two clocks' speeds, that is no jitter

Tell = Callable[[str, str], None]  # code, sentence


class Moment(NamedTuple):
    """Times of a picture: of its logging, and its own stamp."""

    log_ns: int
    stamp_ns: int | None


class Delays:
    """Leads of stamps on log times, of the messages that came last."""

    def __init__(self, count: int) -> None:
        self._last: deque[int] = deque(maxlen=count)
        self._median: int | None = None

    def add(self, delay_ns: int) -> None:
        """Count in the delay of a message."""
        self._last.append(delay_ns)
        self._median = None

    @property
    def usual_ns(self) -> int | None:
        """The median; None if no message states a time."""
        if self._median is None and self._last:
            self._median = round(median(self._last))
        return self._median


class CameraClock:
    """The times of one camera's pictures, in the order in which they are given on.

    Args:
        tell: hears what is wrong with them.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._behind: deque[Moment] = deque(maxlen=AROUND)
        self._intervals: deque[int] = deque(maxlen=33)
        self._interval_ns: int | None = None
        self._last: tuple[int, int] | None = None  # log time and time of the last picture
        self._shift_ns = 0  # of the stamps, since the clock was set
        self._told: set[str] = set()
        self.log_time_ns = 0  # of the picture that is looked at
        self.delays = Delays(33)
        self.distinct = True  # whether stamps tell pictures apart
        self.seen: deque[Moment] = deque(maxlen=64)  # pictures that came last, given on or not

    @property
    def interval_ns(self) -> int:
        """The usual time between two pictures; 0 if it is not known yet."""
        if self._interval_ns is None:
            steps = self._intervals or self._steps_ahead()
            self._interval_ns = round(median(steps)) if steps else 0
        return self._interval_ns

    def _steps_ahead(self) -> list[int]:
        """Return the times between pictures that have come and wait."""
        steps = [
            b.log_ns - a.log_ns
            if a.stamp_ns is None or b.stamp_ns is None
            else b.stamp_ns - a.stamp_ns
            for a, b in pairwise(self.seen)
        ]
        return [step for step in steps if step > 0]

    def trusts(self, moment: Moment) -> bool:
        """Return whether a picture's stamp runs with those of the pictures before it."""
        if moment.stamp_ns is None or not self.distinct:
            return False
        usual_ns = self.delays.usual_ns
        own_ns = moment.stamp_ns - moment.log_ns
        return usual_ns is None or abs(own_ns - usual_ns) <= CLOCK_STEP_NS

    def capture_time_ns(self, moment: Moment, following: Sequence[Moment]) -> int:
        """Return when a picture was taken, by its times and those of the pictures around it."""
        around = [*self._behind, moment, *following[:AROUND]]
        self._behind.append(moment)
        self.log_time_ns = moment.log_ns
        time_ns = self._by_clocks(moment, around)
        if self._last is not None:
            time_ns = self._going_on(moment, time_ns, *self._last)
            step_ns = time_ns - self._last[1]
            if step_ns > 0:
                self._intervals.append(step_ns)
                self._interval_ns = None
        self._last = moment.log_ns, time_ns
        return time_ns

    def _by_clocks(self, moment: Moment, around: list[Moment]) -> int:
        stamped = [m for m in around if m.stamp_ns is not None]
        factor = self._factor(stamped)
        self.distinct = factor is not None
        if factor is None or not stamped:
            return moment.log_ns * self._unit_of_logs(around)
        delays = [(m.stamp_ns or 0) * factor - m.log_ns for m in stamped]
        usual_ns = round(median(delays))
        if moment.stamp_ns is None:
            return moment.log_ns + usual_ns
        own_ns = moment.stamp_ns * factor - moment.log_ns
        alike = sum(abs(d - usual_ns) <= CLOCK_STEP_NS for d in delays)
        is_off = abs(own_ns - usual_ns) > CLOCK_STEP_NS and alike >= 3 and alike > len(delays) / 2
        if is_off and not self._follows(moment, around):
            self._tell(
                "time_outlier",
                f"the stamp of a picture is {(own_ns - usual_ns) / 1e9:+,.1f} s off those of the "
                "pictures around it; the log time and the usual delay were used",
            )
            return moment.log_ns + usual_ns
        if factor == 1:
            self.delays.add(own_ns)
        return moment.stamp_ns * factor

    def _follows(self, moment: Moment, around: list[Moment]) -> bool:
        """Return whether a stamp goes on from the one before it: then the log's clock was set."""
        at = around.index(moment)
        before = around[at - 1].stamp_ns if at else None
        if before is None or moment.stamp_ns is None:
            return False
        return 0 < moment.stamp_ns - before <= max(CLOCK_STEP_NS, 5 * self.interval_ns)

    def _factor(self, stamped: list[Moment]) -> int | None:
        """Return by what stamps must be multiplied to be nanoseconds; None: they are no times."""
        if len(stamped) < 4:
            return 1 if self.distinct else None
        stamps = [m.stamp_ns or 0 for m in stamped]
        steps = [b - a for a, b in pairwise(stamps)]
        logs = [b.log_ns - a.log_ns for a, b in pairwise(stamped)]
        step_ns, log_ns = median(steps), median(logs)
        if log_ns <= 0:  # the log says nothing
            return 1 if step_ns > 0 else None
        factor = _unit(stamps, step_ns)
        if factor != 1:
            text = f"the stamps of pictures are in {_UNITS[factor]}, not nanoseconds; they were read so"
            self._once("time_unit", text)
            return factor
        repeated = sum(step == 0 for step in steps) / len(steps)
        if repeated > 0.3 or _are_whole_seconds(stamps, log_ns):
            text = "the stamps of pictures repeat or are whole seconds; the log times were used"
            self._once("stamps_unused", text)
            return None
        if step_ns <= 0 or (step_ns < _SHORTEST_NS and log_ns > _RATIO * step_ns):
            text = f"the stamps of pictures follow each other every {step_ns / 1e9:.9f} s, the pictures "
            text += f"every {log_ns / 1e9:.3f} s; the log times were used"
            self._once("stamps_unused", text)
            return None
        return 1

    def _unit_of_logs(self, around: list[Moment]) -> int:
        logs = [m.log_ns for m in around]
        if len(logs) < 4:
            return 1
        step_ns = median(b - a for a, b in pairwise(logs))
        factor = _unit(logs, step_ns) if step_ns > 0 else 1
        if factor != 1:
            text = f"the log times of pictures are in {_UNITS[factor]}, not nanoseconds; they were "
            self._once("time_unit", text + "read so")
        elif 0 <= step_ns < _SHORTEST_NS:
            text = f"pictures follow each other every {step_ns / 1e9:.9f} s by the only times that they "
            text += "have: tracks and speeds cannot be right; write the recording with true times"
            self._once("no_times", text)
        return factor

    def _going_on(self, moment: Moment, time_ns: int, last_log_ns: int, last_ns: int) -> int:
        """Return a picture's time as it goes on from the last one, if its clock was set."""
        step_ns = time_ns + self._shift_ns - last_ns
        log_step_ns = moment.log_ns - last_log_ns
        if log_step_ns < 0 and step_ns < -CLOCK_STEP_NS // 2:
            self._shift_ns += max(self.interval_ns, 1) - step_ns
            text = (
                f"all clocks were set back by {-log_step_ns / 1e9:,.1f} s; times from here on go on"
            )
            self._tell("clock_step", text)
            return time_ns + self._shift_ns
        if abs(step_ns - log_step_ns) <= CLOCK_STEP_NS or log_step_ns <= 0:
            return time_ns + self._shift_ns
        longest_ns = max(CLOCK_STEP_NS, 5 * self.interval_ns)
        if 0 < step_ns <= longest_ns:
            text = f"the log's clock was set by {(log_step_ns - step_ns) / 1e9:+,.1f} s; the pictures' "
            self._tell("clock_step", text + "own clock goes on, and was used")
            return time_ns + self._shift_ns
        if log_step_ns > longest_ns and step_ns > 0:
            return time_ns + self._shift_ns  # a pause; which clock is right cannot be told
        self._shift_ns += log_step_ns - step_ns
        text = f"the pictures' clock was set by {(step_ns - log_step_ns) / 1e9:+,.1f} s; times from here "
        self._tell("clock_step", text + "on go on as the log's clock does")
        return time_ns + self._shift_ns

    def _once(self, code: str, text: str) -> None:
        if code not in self._told:
            self._told.add(code)
            self._tell(code, text)


def _unit(times: Sequence[int], step: float) -> int:
    """Return 1000, 10^6 or 10^9 for times of this century in a coarser unit than ns, else 1."""
    low, high = _MODERN_NS
    middle = median(times)
    for factor in _UNITS:
        # Coarser times are far smaller numbers: in nanoseconds they would be days of the year 1970.
        if low <= middle * factor <= high and 0 < step < _SHORTEST_NS:
            return factor
    return 1


def _are_whole_seconds(stamps: Sequence[int], log_step_ns: float) -> bool:
    whole = all(stamp % SECOND_NS == 0 for stamp in stamps)
    off_ns = log_step_ns % SECOND_NS
    return whole and min(off_ns, SECOND_NS - off_ns) > 20 * MS_NS
