"""Cadence of people who walk: steps a second, read from the edges of their boxes.

The head rises and falls once a step, and from the side the legs open and close once a step, so the upper
edge and the width of a box swing at the cadence. In windows of a few seconds both are fitted with a
sinusoid after the slow change of the way is taken out; the noise beside which the swing must stand out is
a first-order autoregressive process (box errors last from frame to frame). Cadence tells about clocks,
and beside a prior of statures it adds nothing to the scale.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.tables import TRACK_CADENCES
from pipeline.estimate.gait import WALKER
from pipeline.estimate.types import Measured

# Adults walk at 1.3 to 2.6 steps a second (Whittle, Gait Analysis: 91-138 steps a minute at free speed,
# and some hurry). The search is wider, so that clocks that are wrong show.
CADENCES_HZ = (1.3, 2.6)
SEARCH_HZ = np.arange(0.9, 3.81, 0.02)
WINDOW_S = 5.0
MIN_SPAN_S = 3.0  # of the boxes in a window
MIN_IN_WINDOW = 16
MIN_RATE_HZ = 5.0  # fewer boxes a second show no steps
NYQUIST_SHARE = 0.45  # of the rate of the boxes, up to which a swing can be told from its mirror
FALSE_ALARM = 1e-5
# Windows of one walker agree to some per cent; one that is farther off saw something else.
AGREE = 0.12
PACE_STD = 0.02  # relative: nobody walks more evenly from one window to the next
MAX_GAP_S = 0.5


@dataclass(frozen=True, slots=True)
class _Windows:
    """Boxes of walkers by window of a track, (w, k): padded, `there` being the real ones."""

    track_id: IntArray  # (w,)
    time_s: FloatArray
    there: FloatArray
    signals: tuple[FloatArray, ...]  # upper edge and width, in shares of the height; mean taken out


def cadences(m: Measured, speed_m_s: FloatArray | None = None) -> pa.Table:
    """Return the cadence of each track that shows one, with its deviation, as rows of `track_cadences`.

    Args:
        m: observations of whole tracks.
        speed_m_s: of each observation on the ground, (n,), NaN or None where it is unknown.
    """
    windows = _windows(m)
    if windows is None:
        return TRACK_CADENCES.empty_table()
    found_hz, std_hz = _swing(windows)
    rows = []
    for track in np.unique(windows.track_id[np.isfinite(found_hz)]):
        mine = np.isfinite(found_hz) & (windows.track_id == track)
        summary = _of_track(found_hz[mine], std_hz[mine])
        if summary is not None:
            rows.append((m.camera, int(track), *summary, _speed(m, int(track), speed_m_s)))
    if not rows:
        return TRACK_CADENCES.empty_table()
    columns = zip(*rows, strict=True)
    arrays = [
        pa.array(c, type=f.type, from_pandas=True)
        for c, f in zip(columns, TRACK_CADENCES, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=TRACK_CADENCES)


def possible(found: pa.Table) -> pa.Table:
    """Return the rows whose cadence is one at which people walk."""
    low, high = CADENCES_HZ
    hz = found["cadence_hz"]
    return found.filter(pc.and_(pc.greater_equal(hz, low), pc.less_equal(hz, high)))


def _speed(m: Measured, track: int, speed_m_s: FloatArray | None) -> float | None:
    if speed_m_s is None:
        return None
    mine = speed_m_s[(m.track_id == track) & np.isfinite(speed_m_s)]
    return float(np.median(mine)) if len(mine) else None


def _of_track(found_hz: FloatArray, std_hz: FloatArray) -> tuple[float, float, int] | None:
    """Return the mean cadence of windows that agree, its deviation, and how many they are."""
    middle = np.median(found_hz)
    agree = np.abs(found_hz / middle - 1) < AGREE
    if agree.sum() * 2 <= len(found_hz):
        return None
    found_hz, std_hz = found_hz[agree], np.hypot(std_hz[agree], PACE_STD * middle)
    weight = std_hz**-2
    mean = float((found_hz * weight).sum() / weight.sum())
    scatter = ((found_hz - mean) ** 2 * weight).sum() / max(len(found_hz) - 1, 1)
    return mean, float(np.sqrt(max(scatter, 1.0) / weight.sum())), len(found_hz)


def _windows(m: Measured) -> _Windows | None:
    """Return the windows with enough boxes that were measured, whole, and close enough in time."""
    box = m.bbox_xyxy_px if m.raw_bbox_xyxy_px is None else m.raw_bbox_xyxy_px
    wide_px, tall_px = box[:, 2] - box[:, 0], box[:, 3] - box[:, 1]
    usable = ~m.truncated.any(axis=1) & (tall_px > 0) & (wide_px > 0) & (m.occlusion < 0.05)
    usable &= m.class_name == WALKER
    if m.filled is not None:
        usable &= ~m.filled
    rows = np.flatnonzero(usable)
    if len(rows) < MIN_IN_WINDOW:
        return None
    rows = rows[np.lexsort((m.capture_time_ns[rows], m.track_id[rows]))]
    track, time_ns = m.track_id[rows], m.capture_time_ns[rows]
    new_track = np.concatenate([[True], np.diff(track) != 0])
    begin = np.flatnonzero(new_track)[np.cumsum(new_track) - 1]
    time_s = (time_ns - time_ns[begin]) / 1e9
    number = np.floor(time_s / WINDOW_S).astype(np.int64)
    gap = np.concatenate([[0.0], np.diff(time_s)]) > MAX_GAP_S
    new = new_track | np.concatenate([[True], np.diff(number) != 0]) | gap
    starts = np.flatnonzero(new)
    count = np.diff(np.append(starts, len(rows)))
    ends = starts + count - 1
    span_s = time_s[ends] - time_s[starts]
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = (count - 1) / span_s
    good = (count >= MIN_IN_WINDOW) & (span_s >= MIN_SPAN_S) & (rate >= MIN_RATE_HZ * 0.95)
    if not good.any():
        return None
    starts, count = starts[good], count[good]
    at = starts[:, None] + np.minimum(np.arange(count.max()), count[:, None] - 1)
    there = (np.arange(count.max()) < count[:, None]).astype(np.float64)
    t = time_s[at] - time_s[at].mean(axis=1, keepdims=True)
    size_px = (tall_px[rows[at]] * there).sum(axis=1, keepdims=True) / count[:, None]
    top, width = box[rows, 1][at] / size_px, wide_px[rows][at] / tall_px[rows][at]
    signals = tuple(_level(t, there, y) for y in (top, width))
    return _Windows(track[starts], t, there, signals)


def _level(t: FloatArray, there: FloatArray, y: FloatArray) -> FloatArray:
    """Return signals, (w, k), less the cubic in time that fits them: the way, and its perspective."""
    x = t / WINDOW_S
    basis = np.stack([np.ones_like(x), x, x**2, x**3], axis=2) * there[:, :, None]
    normal = np.einsum("wki,wkj->wij", basis, basis) + 1e-9 * np.eye(4)
    fit = np.linalg.solve(normal, np.einsum("wki,wk->wi", basis, y)[:, :, None])
    return np.asarray((y - (basis @ fit)[:, :, 0]) * there)


def _swing(windows: _Windows) -> tuple[FloatArray, FloatArray]:
    """Return the frequency of each window's swing and its deviation, (w,); NaN where noise would do.

    By Whittle's likelihood the evidence for a sinusoid of amplitude A in n values with noise of density S
    is n A^2 / (4 S), which of noise alone is exponentially distributed; that of two signals adds.
    """
    count = windows.there.sum(axis=1)
    rate = (count - 1) / np.ptp(windows.time_s, axis=1)
    evidence = np.zeros((len(count), len(SEARCH_HZ)))
    for y in windows.signals:
        square = _square_amplitudes(windows, y)
        noise = _noise(windows, y, rate, square)
        evidence += count[:, None] * square / (4 * noise)
    evidence[SEARCH_HZ[None, :] > NYQUIST_SHARE * rate[:, None]] = 0.0
    best = evidence.argmax(axis=1)
    most = evidence.max(axis=1)
    span_s = np.ptp(windows.time_s, axis=1)
    tries = np.maximum(2 * span_s * np.ptp(SEARCH_HZ), 1.0)
    chance = tries * (1 + most) * np.exp(-most)  # of the sum of two exponentials
    inside = (best > 0) & (best < len(SEARCH_HZ) - 1)
    found = inside & (chance < FALSE_ALARM)
    where = np.clip(best, 1, len(SEARCH_HZ) - 2)
    each = np.arange(len(count))
    left, middle, right = (evidence[each, where + i] for i in (-1, 0, 1))
    bend = np.minimum(left - 2 * middle + right, -1e-9)
    found &= (left > 0) & (right > 0)
    step_hz = SEARCH_HZ[1] - SEARCH_HZ[0]
    hz = SEARCH_HZ[where] + np.clip((left - right) / (2 * bend), -1, 1) * step_hz
    # Cramer and Rao: var f = 6 S / (n A^2 (pi T)^2) = 3 / (2 E (pi T)^2).
    std_hz = np.sqrt(1.5 / np.maximum(most, 1e-9)) / (np.pi * span_s)
    return np.where(found, hz, np.nan), np.where(found, std_hz, np.nan)


def _square_amplitudes(windows: _Windows, y: FloatArray) -> FloatArray:
    """Return the squared amplitude of the sinusoid that fits a signal, (w, f), by frequency."""
    count = windows.there.sum(axis=1)
    turn = np.exp(2j * np.pi * SEARCH_HZ[0] * windows.time_s)
    step = np.exp(2j * np.pi * (SEARCH_HZ[1] - SEARCH_HZ[0]) * windows.time_s)
    square = np.empty((len(count), len(SEARCH_HZ)))
    for i in range(len(SEARCH_HZ)):
        square[:, i] = np.abs((turn * y).sum(axis=1) * 2 / count) ** 2
        turn = turn * step
    return square


def _noise(windows: _Windows, y: FloatArray, rate: FloatArray, square: FloatArray) -> FloatArray:
    """Return the spectral density of the noise a value, (w, f): AR(1), the strongest swing left out."""
    count = windows.there.sum(axis=1)
    strongest = SEARCH_HZ[square.argmax(axis=1)][:, None]
    turn = np.exp(2j * np.pi * strongest * windows.time_s)
    amplitude = (turn.conj() * y).sum(axis=1, keepdims=True) * 2 / count[:, None]
    rest = (y - (amplitude * turn).real) * windows.there
    power = np.maximum((rest**2).sum(axis=1) / np.maximum(count - 6, 1), 1e-12)
    lag = (rest[:, 1:] * rest[:, :-1]).sum(axis=1) / np.maximum(count - 7, 1) / power
    lag = np.clip(lag, -0.3, 0.95)[:, None]
    angle = 2 * np.pi * SEARCH_HZ[None, :] / rate[:, None]
    shape = (1 - lag**2) / (1 - 2 * lag * np.cos(angle) + lag**2)
    return np.asarray(power[:, None] * shape)
