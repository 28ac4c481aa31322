"""Boxes of one camera with their tracks, as columns: what the offline stages work on."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from pipeline.core.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class BoxRows:
    """A structure of n-long arrays."""

    number: IntArray  # of the row among all of the camera; what is filled in has that before it
    frame: IntArray
    time_s: FloatArray
    track: IntArray
    bbox_xyxy_px: FloatArray  # (n, 4)
    std_px: FloatArray  # (n, 4)
    measured: BoolArray  # False: filled in between two that were
    whole: BoolArray  # no side is cut by the picture's edge
    person: BoolArray  # whether the shape is a person's
    colour: FloatArray  # (n, c), square roots of shares; NaN where nobody looked

    def __len__(self) -> int:
        return len(self.frame)

    def take(self, rows: IntArray | BoolArray) -> BoxRows:
        """Return the rows at `rows`: positions, or a mask."""
        return BoxRows(*(getattr(self, f.name)[rows] for f in fields(self)))

    def with_rows(self, more: BoxRows) -> BoxRows:
        """Return the same with more rows after them."""
        pairs = ((getattr(self, f.name), getattr(more, f.name)) for f in fields(self))
        return BoxRows(*(np.concatenate(pair) for pair in pairs))

    def by_track(self) -> BoxRows:
        """Return the rows in order of track, then frame."""
        return self.take(np.lexsort((self.frame, self.track)))


def filled(rows: BoxRows, frame_time_s: FloatArray, longest_s: float) -> BoxRows:
    """Return rows with those between that are missing from gaps of a track up to `longest_s`.

    Args:
        rows: in order of track, then frame.
        frame_time_s: time of each frame of the camera, by its number.
        longest_s: a longer gap stays one.
    """
    if len(rows) < 2:
        return rows
    step = np.diff(rows.frame)
    gap = (np.diff(rows.track) == 0) & (step > 1) & (np.diff(rows.time_s) <= longest_s)
    before = np.flatnonzero(gap)
    missing = step[before] - 1
    at = np.repeat(before, missing)
    if not len(at):
        return rows
    frame = rows.frame[at] + 1 + _ramp(missing)
    time_s = frame_time_s[frame]
    whole_s = rows.time_s[at + 1] - rows.time_s[at]
    share = (time_s - rows.time_s[at]) / np.where(whole_s > 0, whole_s, 1.0)
    between = replace(
        rows.take(at),
        frame=frame,
        time_s=time_s,
        bbox_xyxy_px=_mixed(rows.bbox_xyxy_px, at, share),
        std_px=_mixed(rows.std_px, at, share),
        measured=np.zeros(len(at), dtype=np.bool_),
    )
    return rows.with_rows(between).by_track()


def _mixed(values: FloatArray, at: IntArray, share: FloatArray) -> FloatArray:
    """Return values between rows `at` and the next ones."""
    return np.asarray(values[at] + (values[at + 1] - values[at]) * share[:, None])


def _ramp(counts: IntArray) -> IntArray:
    """Return 0, 1, ... up to each count, one after another."""
    begins = np.cumsum(counts) - counts
    return np.asarray(np.arange(int(counts.sum())) - np.repeat(begins, counts))
