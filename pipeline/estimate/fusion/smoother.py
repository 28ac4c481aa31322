"""Positions along tracks, smoothed: a Kalman filter forward, Rauch-Tung-Striebel backward.

All tracks are stepped at once, the k-th observation of each; nothing is done object by object. Outliers
get less weight, as under Student's t (the posterior mean of the scale mixture).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.estimate.fusion.kalman import Steps, smoothed

SAYS_NOTHING_M2 = 1e30  # variance of what is not known: its gain is nought to all digits
DEGREES_OF_FREEDOM = 4.0  # Student's t with four: one in a hundred errors is beyond 4.6 deviations
REWEIGHTINGS = 3
BATCH = 100_000  # observations that are worked on at once


@dataclass(frozen=True, slots=True)
class Smoothed:
    """Position and velocity of each observation, by all of its track."""

    position_m: FloatArray  # (n, 2)
    velocity_m_s: FloatArray  # (n, 2)
    covariance: FloatArray  # (n, 2, 2) of the position
    velocity_variance: FloatArray  # (n,) of either component, their mean
    weight: FloatArray  # (n,) 1 for one that fits, less the worse it fits


def smooth_tracks(
    track: IntArray, time_s: FloatArray, position_m: FloatArray, covariance: FloatArray
) -> Smoothed:
    """Smooth the positions of tracks.

    Args:
        track: which track each observation is of, (n,).
        time_s: when it was made, (n,).
        position_m: where, (n, 2); NaN where it says nothing.
        covariance: of its independent error, (n, 2, 2).

    Returns:
        Smoothed positions in the order of the observations.
    """
    count = len(track)
    result = Smoothed(
        np.full((count, 2), np.nan),
        np.full((count, 2), np.nan),
        np.full((count, 2, 2), np.nan),
        np.full(count, np.nan),
        np.ones(count),
    )
    for rows, length in _batches(track, time_s):
        _smooth_batch(rows, length, time_s, position_m, covariance, result)
    return result


def _batches(track: IntArray, time_s: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """Yield rows by track and time, and the lengths of the tracks, longest first, in batches."""
    if not len(track):
        return
    order = np.lexsort((time_s, track))
    starts = np.flatnonzero(np.diff(track[order], prepend=track[order[0]] - 1))
    lengths = np.diff(np.append(starts, len(order)))
    longest = np.argsort(-lengths, kind="stable")
    batch = (np.cumsum(lengths[longest]) - 1) // BATCH
    for number in np.unique(batch):
        mine = longest[batch == number]
        rows = np.concatenate([order[starts[t] : starts[t] + lengths[t]] for t in mine])
        yield rows, lengths[mine]


def _smooth_batch(
    rows: IntArray,
    lengths: IntArray,
    time_s: FloatArray,
    position_m: FloatArray,
    covariance: FloatArray,
    result: Smoothed,
) -> None:
    """Smooth tracks whose observations follow one another in `rows`; the longest come first."""
    steps = Steps.of(lengths, time_s[rows])
    rows = rows[steps.rows]
    seen, noise = position_m[rows], covariance[rows]
    known = np.asarray(np.isfinite(seen).all(axis=1) & np.isfinite(noise).all(axis=(1, 2)))
    seen = np.where(known[:, None], seen, 0.0)
    noise = np.where(known[:, None, None], noise, SAYS_NOTHING_M2 * np.eye(2))
    precision = np.linalg.inv(noise + 1e-12 * np.eye(2))
    weight = np.ones(len(rows))
    for left in reversed(range(REWEIGHTINGS)):
        found = smoothed(steps, seen, noise / weight[:, None, None], covariances=left == 0)
        off = seen - found.position_m
        # The smoothed position has this observation in it; its own noise alone is the measure.
        squared = np.einsum("ni,nij,nj->n", off, precision, off)
        fits = (DEGREES_OF_FREEDOM + 2) / (DEGREES_OF_FREEDOM + squared)
        weight = np.where(known, np.minimum(fits, 1.0), 1.0)
    result.position_m[rows] = found.position_m
    result.velocity_m_s[rows] = found.velocity_m_s
    result.covariance[rows] = found.covariance
    result.velocity_variance[rows] = found.velocity_variance
    result.weight[rows] = weight
