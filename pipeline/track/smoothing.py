"""Boxes smoothed along their track, offline: the frames after a box count as much as those before.

A local linear fit in time (Cleveland 1979, Journal of the American Statistical Association 74:829-836)
with a Gaussian kernel, and weights that take outliers out. Centres, ends and sizes are fitted apart, as
their errors last differently long.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.core.arrays import BoolArray, FloatArray, IntArray
from pipeline.track.rows import BoxRows

# Standard deviations of the kernels. A step takes about 0.5 s: the sides of a box swing with it, its
# middle does not, and the ends bob twice as fast. A walker who sets off or stops within 1.5 s
# (`kalman.ACCELERATION_STD`) is 0.05 body heights off such a line after 0.45 s.
CENTRE_S, END_S, SIZE_S = 0.45, 0.27, 0.68
REACH = 3.0  # standard deviations: beyond it the kernel is below 1 % of its middle
# A person of whom both arms and a stride are seen is at most so wide, as a share of the height; a wider
# box has a shadow or a neighbour in it.
WIDEST = 0.40
ROBUST_STEPS = 2
OUTLYING = 2.0  # median deviations (as standard deviations) at which a weight is one half
SHORTEST = 5  # observations: fewer tell no line from its noise
# Of the variance of a box's end so much is common to boxes half a second apart
# (`pipeline.estimate.boxes.error_correlation`: 0.37 after an eighth of a second, 0.3 after half);
# averaging neighbours leaves it.
LASTING = 0.35
# What is filled in may have been elsewhere: an acceleration of 0.6 body heights a second squared
# (`kalman.ACCELERATION_STD`), bridged at both ends.
FILLED_ACCELERATION = 0.6
# Ends that nobody saw are known as well as those of somebody hidden (`motion.detector.UNSEEN_STD`).
FILLED_STD = 0.07


_Pairs = tuple[IntArray, IntArray, FloatArray, FloatArray]


def smoothed(rows: BoxRows) -> tuple[FloatArray, FloatArray]:
    """Return boxes (n, 4) and their standard deviations (n, 4), smoothed along each track.

    Boxes that the picture cuts, and those of very short tracks, stay as they are.

    Args:
        rows: in order of track, then time.
    """
    box = rows.bbox_xyxy_px
    trusted = rows.measured & rows.whole
    count = pd.Series(trusted).groupby(rows.track).transform("sum").to_numpy()
    changed = (count >= SHORTEST) & (rows.whole | ~rows.measured)
    tall, wide = np.maximum(box[:, 3] - box[:, 1], 1e-6), np.maximum(box[:, 2] - box[:, 0], 1e-6)
    fit = _Fit(rows, trusted)
    centre, _ = fit((box[:, 0] + box[:, 2]) / 2, CENTRE_S)
    width, side_share = fit(np.log(wide), SIZE_S)
    top, end_share = fit(box[:, 1], END_S)
    bottom, _ = fit(box[:, 3], END_S)
    width = np.exp(np.clip(width, None, np.log(wide.max(initial=1.0)) + 1.0))
    height = np.maximum(bottom - top, 1.0)
    width = np.where(rows.person, np.minimum(width, WIDEST * height), width)
    new = np.stack([centre - width / 2, top, centre + width / 2, bottom], axis=1)
    share = np.stack([side_share, end_share, side_share, end_share], axis=1)
    std = rows.std_px * np.sqrt(LASTING + (1 - LASTING) * np.minimum(share, 1.0))
    std = np.hypot(std, (_bridged(rows) * tall)[:, None])
    kept = changed & np.isfinite(new).all(axis=1) & (new[:, 3] > new[:, 1])
    # A short track's box that was filled in stays the straight line between its neighbours.
    return (
        np.where(kept[:, None], new, box),
        np.where((kept | ~rows.measured)[:, None], std, rows.std_px),
    )


def _bridged(rows: BoxRows) -> FloatArray:
    """Return how far what was filled in may be off, in body heights; 0 for what was measured.

    Between two known places T apart, an acceleration a leads a t (T - t) / 2 off the straight line.
    """
    time = pd.Series(np.where(rows.measured, rows.time_s, np.nan))
    since = rows.time_s - time.groupby(rows.track).ffill().to_numpy()
    until = time.groupby(rows.track).bfill().to_numpy() - rows.time_s
    off = np.hypot(FILLED_STD, np.nan_to_num(FILLED_ACCELERATION * since * until / 2))
    return np.where(rows.measured, 0.0, off)


class _Fit:
    """Local linear fits over the rows of each track."""

    def __init__(self, rows: BoxRows, trusted: BoolArray) -> None:
        self._track, self._time_s = rows.track, rows.time_s
        self._trusted = trusted.astype(np.float64)
        begins = np.diff(rows.track, prepend=rows.track[:1] - 1) != 0
        self._first, self._place = np.flatnonzero(begins), np.cumsum(begins) - 1
        self._pairs: dict[float, list[_Pairs]] = {}

    def __call__(self, y: FloatArray, kernel_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the fit at every row, and the share of one row's variance that it has."""
        fitted, share = self._once(y, self._trusted, kernel_s)
        for _ in range(ROBUST_STEPS):
            off = np.abs(y - fitted)
            usual = pd.Series(np.where(self._trusted > 0, off, np.nan)).groupby(self._place)
            scale = 1.4826 * usual.transform("median").to_numpy() + 1e-9
            weight = self._trusted / (1 + np.nan_to_num(off / (OUTLYING * scale)) ** 2)
            fitted, share = self._once(y, weight, kernel_s)
        return fitted, share

    def _once(
        self, y: FloatArray, weight: FloatArray, kernel_s: float
    ) -> tuple[FloatArray, FloatArray]:
        """Weighted least squares of a line about each row (Cleveland 1979, section 2)."""
        base = y[self._first][self._place]  # numbers stay small
        value = y - base
        # Sums over neighbours of w, w d, w d^2, w y, w d y; and of w^2, w^2 d, w^2 d^2.
        sums = np.zeros((8, len(y)))
        sums[0], sums[3], sums[5] = weight, weight * value, weight**2
        for one, other, kernel, apart_s in self._neighbours(kernel_s):
            for at, of, d in ((one, other, apart_s), (other, one, -apart_s)):
                w, wd = weight[of] * kernel, weight[of] * kernel * d
                terms = (w, wd, wd * d, w * value[of], wd * value[of], w * w, w * wd, wd * wd)
                for total, term in zip(sums, terms, strict=True):
                    total[at] += term
        s0, s1, s2, y0, y1, q0, q1, q2 = sums
        s2 = s2 + 1e-6 * kernel_s**2 * s0
        with np.errstate(invalid="ignore", divide="ignore"):
            determinant = s0 * s2 - s1 * s1
            fitted = (s2 * y0 - s1 * y1) / determinant
            # The fit's variance where rows have equal and independent ones.
            share = (s2**2 * q0 - 2 * s1 * s2 * q1 + s1**2 * q2) / determinant**2
        return fitted + base, np.where(np.isfinite(share), share, 1.0)

    def _neighbours(self, kernel_s: float) -> list[_Pairs]:
        """Return the pairs of rows of one track that are near in time, by how many rows apart.

        Each is the rows that come first, the others, the kernel's weight and the time between, (p,).
        """
        if kernel_s not in self._pairs:
            found = self._pairs[kernel_s] = []
            one = np.arange(len(self._track))
            for step in range(1, len(self._track)):
                one = one[one < len(self._track) - step]
                apart_s = self._time_s[one + step] - self._time_s[one]
                near = (self._track[one + step] == self._track[one]) & (apart_s < REACH * kernel_s)
                one, apart_s = one[near], apart_s[near]  # farther ones are farther still
                if not len(one):
                    break
                kernel = np.exp(-0.5 * (apart_s / kernel_s) ** 2)
                found.append((one, one + step, kernel, apart_s))
        return self._pairs[kernel_s]
