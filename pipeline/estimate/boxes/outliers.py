"""Boxes of a track that do not go with the rest of it, by the picture alone.

On flat ground the height of one person's box follows the row of their head: h = a + b y_h, to first
order, whatever the camera's pose. Where the feet are hidden the box is shorter than that; where somebody
or something else is in the box, taller. The line is found by the least median of squares (Rousseeuw
1984), so that a third of a track may be bad without harm.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.robust import MAD_TO_STD
from pipeline.estimate.types import BoolArray, Measured

SAMPLE = 41  # observations of a track, spread over it, that the line is found from
TRIALS = 80  # pairs of them: with a third bad, all pairs are with a chance of 1e-20
MIN_ROWS = 8
APART = 0.02  # of the box's height: heads nearer than that make no line
# What goes with the rest: the gait, the feet of a stride, the line not being one quite.
OWN_STD = 0.02  # of the box's height
OFF = 4.0  # standard deviations


def height_off_px(m: Measured, usable: BoolArray) -> FloatArray:
    """Return how much taller each box is than its track's line says, (n,), 0 where it goes with it.

    Args:
        m: the observations.
        usable: whose both ends are seen; of the others nothing is said, (n,).
    """
    off_px = np.zeros(len(m))
    rows = np.flatnonzero(usable)
    if not len(rows):
        return off_px
    rows = rows[np.lexsort((m.capture_time_ns[rows], m.track_id[rows]))]
    new = np.concatenate([[True], np.diff(m.track_id[rows]) != 0])
    starts = np.flatnonzero(new)
    count = np.diff(np.append(starts, len(rows)))
    group = np.cumsum(new) - 1
    head_px = m.bbox_xyxy_px[rows, 1]
    tall_px = m.bbox_xyxy_px[rows, 3] - head_px
    std_px = np.hypot(m.std_xyxy_px[rows, 1], m.std_xyxy_px[rows, 3])
    spread = np.linspace(0, 1, SAMPLE)
    at = starts[:, None] + np.rint(spread * (count[:, None] - 1)).astype(np.intp)  # (t, SAMPLE)
    level, slope, scale = _lines(head_px[at], tall_px[at])
    expected_px = level[group] + slope[group] * head_px
    residual = tall_px - expected_px
    allowed = np.hypot(scale[group], np.hypot(std_px, OWN_STD * np.abs(expected_px)))
    odd = (np.abs(residual) > OFF * allowed) & (count[group] >= MIN_ROWS)
    off_px[rows] = np.where(odd, residual, 0.0)
    return off_px


def _lines(head: FloatArray, tall: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return level, slope and scale of the line of least median square of each row of (t, SAMPLE)."""
    level, slope = np.median(tall, axis=1), np.zeros(len(tall))
    best = np.median(np.abs(tall - level[:, None]), axis=1)
    near = APART * np.abs(level)
    pairs = np.random.default_rng(0).integers(0, SAMPLE, (TRIALS, 2))
    for i, j in pairs:
        run = head[:, j] - head[:, i]
        with np.errstate(invalid="ignore", divide="ignore"):
            b = np.where(np.abs(run) > near, (tall[:, j] - tall[:, i]) / run, 0.0)
        a = tall[:, i] - b * head[:, i]
        apart = np.median(np.abs(tall - a[:, None] - b[:, None] * head), axis=1)
        better = apart < best
        level, slope = np.where(better, a, level), np.where(better, b, slope)
        best = np.where(better, apart, best)
    return level, slope, MAD_TO_STD * best
