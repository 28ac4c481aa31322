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
from pipeline.estimate.by_track import median_by
from pipeline.estimate.types import BoolArray, Measured

SAMPLE = 41  # observations of a track, spread over it, that the line is found from
TRIALS = 80  # pairs of them: with a third bad, all pairs are with a chance of 1e-20
MIN_ROWS = 8
APART = 0.02  # of the box's height: heads nearer than that make no line
# What goes with the rest: the gait, the feet of a stride, the line not being one quite.
OWN_STD = 0.02  # of the box's height
OFF = 4.0  # standard deviations
JUMP_NS = 2_500_000_000  # between the frames before and after: in more, people turn and bend
ALIKE = 2.0  # standard deviations within which a box is as tall as its track says


def height_off_px(m: Measured, usable: BoolArray) -> FloatArray:
    """Return how much taller each box is than its track's line says, (n,), 0 where it goes with it.

    Args:
        m: the observations.
        usable: whose both ends are seen; of the others nothing is said, (n,).
    """
    residual_px, allowed_px, _ = _beside_line(m, usable)
    with np.errstate(invalid="ignore"):
        odd = np.abs(residual_px) > OFF * allowed_px
    return np.where(odd, residual_px, 0.0)


def goes_with_track(m: Measured, usable: BoolArray) -> BoolArray:
    """Return which boxes are as tall as the others of their track say, (n,).

    By the line of heights over rows, or by how heights go on from frame to frame: before a camera that is
    as high as the heads all heads are on one row, and there is no line.

    Args:
        m: the observations.
        usable: of the others nothing is said, (n,).
    """
    residual_px, _, scale_px = _beside_line(m, usable)
    tall_px = m.bbox_xyxy_px[:, 3] - m.bbox_xyxy_px[:, 1]
    std_px = np.hypot(m.std_xyxy_px[:, 1], m.std_xyxy_px[:, 3])
    close_px = np.hypot(std_px, OWN_STD * tall_px)
    jump, usual_jump = _jumps(m, usable, tall_px)
    with np.errstate(invalid="ignore"):
        in_line = (scale_px < close_px) & (np.abs(residual_px) < ALIKE * close_px)
        steady = (usual_jump * tall_px < close_px) & (np.abs(jump) * tall_px < ALIKE * close_px)
    return np.asarray(in_line | steady)


def _jumps(m: Measured, usable: BoolArray, tall_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far each height is off the middle of those before and after it, and the track's scale.

    Relative, as the deviation of one height, (n,) each; NaN of those that are not between two.
    """
    found = np.full((2, len(m)), np.nan)
    rows = np.flatnonzero(usable & (tall_px > 0))
    rows = rows[np.lexsort((m.capture_time_ns[rows], m.track_id[rows]))]
    if len(rows) < MIN_ROWS:
        return found[0], found[1]
    track, log = m.track_id[rows], np.log(tall_px[rows])
    bend = (log[1:-1] - (log[:-2] + log[2:]) / 2) / np.sqrt(1.5)  # of one of variance 1: 1 + 2 / 4
    time_ns = m.capture_time_ns[rows]
    near = (track[:-2] == track[2:]) & (time_ns[2:] - time_ns[:-2] < JUMP_NS)
    found[0, rows[1:-1]] = np.where(near, bend, np.nan)
    # The first and the last of a track are as the ones next to them.
    edge = np.isnan(found[0, rows])
    for step in (1, -1):
        beside = np.roll(found[0, rows], step)
        same = np.roll(track, step) == track
        found[0, rows] = np.where(edge & same & np.isnan(found[0, rows]), beside, found[0, rows])
    known = np.abs(found[0])
    found[1] = MAD_TO_STD * median_by(m.track_id, known)
    return found[0], found[1]


def _beside_line(m: Measured, usable: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each box's distance from its track's line, what is allowed, and the scale, (n,) each.

    NaN of those that are not usable, and of tracks with fewer than MIN_ROWS that are.
    """
    found = np.full((3, len(m)), np.nan)
    rows = np.flatnonzero(usable)
    if not len(rows):
        return found[0], found[1], found[2]
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
    allowed_px = np.hypot(scale[group], np.hypot(std_px, OWN_STD * np.abs(expected_px)))
    enough = count[group] >= MIN_ROWS
    columns = np.stack([tall_px - expected_px, allowed_px, scale[group]])
    found[:, rows] = np.where(enough, columns, np.nan)
    return found[0], found[1], found[2]


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
