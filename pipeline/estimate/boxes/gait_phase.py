"""Phase of a walker's stride, as far as the width of the box tells it.

From the side, legs open and close once a step, and the box with them. The share of the width in the
height is fitted with a sinusoid in windows of a few seconds, at the frequencies at which people step;
where noise would do as well, the phase is unknown (as it is for all who walk straight to or from the
camera).
"""

from __future__ import annotations

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.estimate.types import Measured

# Adults take 1.5 to 2.5 steps a second (Whittle, Gait Analysis: 91-138 steps a minute at free speed).
STEPS_HZ = np.arange(1.4, 2.61, 0.1)
WINDOW_S = 3.0  # within it the pace is steady
MIN_IN_WINDOW = 12
MAX_STEP_S = 0.17  # between frames: three a step at least
FALSE_ALARM = 0.001  # of windows without a rhythm that seem to have one


def stride_phase_rad(m: Measured) -> FloatArray:
    """Return the phase of the step, (n,): 0 with the feet farthest apart, pi when together; or NaN."""
    phase = np.full(len(m), np.nan)
    width_px = m.bbox_xyxy_px[:, 2] - m.bbox_xyxy_px[:, 0]
    tall_px = m.bbox_xyxy_px[:, 3] - m.bbox_xyxy_px[:, 1]
    usable = ~m.truncated.any(axis=1) & (tall_px > 0) & (width_px > 0) & (m.occlusion < 0.05)
    rows = np.flatnonzero(usable)
    if len(rows) < MIN_IN_WINDOW:
        return phase
    rows = rows[np.lexsort((m.capture_time_ns[rows], m.track_id[rows]))]
    track, time_ns = m.track_id[rows], m.capture_time_ns[rows]
    first = np.concatenate([[True], np.diff(track) != 0])
    time_s = (time_ns - time_ns[np.flatnonzero(first)][np.cumsum(first) - 1]) / 1e9
    window = np.floor(time_s / WINDOW_S).astype(np.int64)
    new = np.concatenate([[True], (np.diff(track) != 0) | (np.diff(window) != 0)])
    starts = np.flatnonzero(new)
    group = np.cumsum(new) - 1
    count = np.diff(np.append(starts, len(rows))).astype(np.float64)

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(values, starts) / count)

    wide = width_px[rows] / tall_px[rows]
    # A straight line out: who turns, or comes nearer, changes slowly.
    t = time_s - mean(time_s)[group]
    y = wide - mean(wide)[group]
    square = mean(t * t)
    slope = np.divide(mean(t * y), square, out=np.zeros_like(square), where=square > 0)
    y = y - slope[group] * t
    power = mean(y * y)
    best, angle = np.zeros(len(starts)), np.full(len(rows), np.nan)
    for f in STEPS_HZ:
        turn = 2 * np.pi * f * t
        cos, sin = np.cos(turn), np.sin(turn)
        cc, ss, cs = mean(cos * cos), mean(sin * sin), mean(cos * sin)
        yc, ys = mean(y * cos), mean(y * sin)
        det = cc * ss - cs * cs
        with np.errstate(invalid="ignore", divide="ignore"):
            a, b = (yc * ss - ys * cs) / det, (ys * cc - yc * cs) / det
            share = np.where(det > 1e-6, (a * yc + b * ys) / power, 0.0)
        better = np.nan_to_num(share) > best
        best = np.where(better, share, best)
        angle = np.where(better[group], turn - np.arctan2(b, a)[group], angle)
    with np.errstate(invalid="ignore"):
        # Of white noise a sinusoid takes more than s of the power with chance (1 - s)^((n - 4) / 2).
        chance = np.clip(1 - best, 0.0, 1.0) ** (np.maximum(count - 4, 1) / 2) * len(STEPS_HZ)
        span_s = np.maximum.reduceat(time_s, starts) - np.minimum.reduceat(time_s, starts)
    dense = span_s / np.maximum(count - 1, 1) <= MAX_STEP_S
    found = (chance < FALSE_ALARM) & (count >= MIN_IN_WINDOW) & dense
    wrapped = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    phase[rows] = np.where(found[group], wrapped, np.nan)
    return phase
