"""Tracks of one camera refined offline, a stretch of time after another.

    rows of the tracker -> cut -> linked -> gaps filled -> smoothed

Memory is that of a stretch. A stretch is decided when the time after it that can matter is known, and the
stretches that follow keep to it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.track import linking
from pipeline.track.cutting import cut, overlapping
from pipeline.track.rows import BoxRows, filled
from pipeline.track.smoothing import REACH, SIZE_S, smoothed

# Rows that are worked on at once, at about 1 kB each with their neighbours.
STRETCH_ROWS = 20_000
# A link is settled when the speed of every tracklet that may compete for it is known.
LINK_AHEAD_S = linking.LONGEST_GAP_S + 2 * linking.END_S
SMOOTH_AHEAD_S = REACH * SIZE_S + 1.0
BEHIND_S = 12.0  # so much of what is settled tells the colour and height of those who go on
# A walker is behind a lamp post or another person for less, and is on a straight line meanwhile; filling
# beyond that costs precision.
FILLED_S = 1.0


class Refiner:
    """Takes the rows of one camera in order of time, and gives them back refined, later."""

    def __init__(self, frame_time_s: FloatArray, stretch: int = STRETCH_ROWS) -> None:
        """Take the times of all frames, (f,), by their number; they never fall."""
        self._frame_time_s = frame_time_s
        self._stretch = stretch
        self._rows: BoxRows | None = None
        self._known = np.empty(0, dtype=np.int64)  # track of each row, as linked; -1: not settled
        self._settled_s = self._given_s = -np.inf
        self._tracks = 0

    def add(self, rows: BoxRows) -> None:
        """Take rows that are later than those before."""
        self._rows = rows if self._rows is None else self._rows.with_rows(rows)
        self._known = np.concatenate([self._known, np.full(len(rows), -1, dtype=np.int64)])

    @property
    def oldest(self) -> int | None:
        """The number of the first row that is still needed; None if there is none."""
        rows = self._rows
        return int(rows.number.min()) if rows is not None and len(rows) else None

    def ready(self, *, last: bool = False) -> BoxRows | None:
        """Return the rows that are decided by now, in order of frame; all of them at the end.

        None is returned as long as there are too few to be worth it.
        """
        rows = self._rows
        if rows is None or not len(rows):
            return None
        end_s = np.inf if last else float(rows.time_s[-1]) - LINK_AHEAD_S
        waiting = int((self._known < 0).sum())
        if not last and (waiting < self._stretch or end_s <= self._settled_s):
            return None
        self._settle(rows, end_s)
        given = self._give(rows, end_s if last else end_s - SMOOTH_AHEAD_S)
        keep = rows.time_s >= end_s - BEHIND_S
        self._rows, self._known = rows.take(keep), self._known[keep]
        self._settled_s = end_s
        return given

    def _settle(self, rows: BoxRows, end_s: float) -> None:
        """Find the tracks of the tracklets that begin before a time."""
        order = np.lexsort((rows.frame, rows.track))
        some = rows.take(order)
        together = overlapping(some.frame, some.bbox_xyxy_px)
        piece = cut(some.track, some.time_s, some.bbox_xyxy_px, together)
        t = linking.describe(piece, some.track, some.time_s, some.bbox_xyxy_px, some.colour)
        known = np.full(len(t.count), -1, dtype=np.int64)
        np.maximum.at(known, piece, self._known[order])
        follows = linking.link(t, known >= 0, _goes_on(known, t.begin.time_s))
        for one in np.argsort(t.begin.time_s, kind="stable"):
            if known[one] < 0:
                known[one], self._tracks = self._tracks, self._tracks + 1
            if follows[one] >= 0:
                known[follows[one]] = known[one]
        settled = t.begin.time_s[piece] < end_s
        self._known[order[settled]] = known[piece[settled]]

    def _give(self, rows: BoxRows, end_s: float) -> BoxRows:
        """Fill and smooth the tracks, and return the rows up to a time that were not given yet."""
        near = (self._known >= 0) & (rows.time_s >= self._given_s - SMOOTH_AHEAD_S)
        some = replace(rows.take(near), track=self._known[near]).by_track()
        some = filled(some, self._frame_time_s, FILLED_S)
        box, std = smoothed(some)
        some = replace(some, bbox_xyxy_px=box, std_px=std)
        some = some.take((some.time_s >= self._given_s) & (some.time_s < end_s))
        self._given_s = end_s
        return some.take(np.lexsort((some.track, some.frame)))


def _goes_on(known: IntArray, begins_s: FloatArray) -> np.ndarray:
    """Return whether a later tracklet of its track is known of each tracklet, (t,)."""
    latest = np.full(int(known.max(initial=-1)) + 2, -np.inf)
    np.maximum.at(latest, known, begins_s)
    return np.asarray((known >= 0) & (latest[known] > begins_s))
