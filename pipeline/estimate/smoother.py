"""Positions along tracks, smoothed: a Kalman filter forward, Rauch-Tung-Striebel backward.

The state is [x, y, vx, vy] in metres with nearly constant velocity (white acceleration: Bar-Shalom
2001, 6.2.2). All tracks are stepped at once, the k-th observation of each; nothing is done object by
object. Outliers get less weight, as under Student's t (the posterior mean of the scale mixture).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.records import FloatArray, IntArray

# A walker sets off, stops or turns within about a second: a change of speed of 0.7 m/s in one second,
# as a random walk of the velocity.
ACCELERATION_DENSITY = 0.5  # m^2/s^3
SPEED_STD_M_S = 1.5  # of somebody of whom nothing is known yet
FAR_M = 1e3  # nothing is known of where they are
DEGREES_OF_FREEDOM = 4.0  # Student's t with four: one in a hundred errors is beyond 4.6 deviations
REWEIGHTINGS = 3
BATCH = 100_000  # observations that are worked on at once

_POSITION = slice(0, 2)


@dataclass(frozen=True, slots=True)
class Smoothed:
    """What is known of each observation after all of its track was seen."""

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
    steps = _Steps.of(lengths)
    seen, noise, when = position_m[rows], covariance[rows], time_s[rows]
    known = np.asarray(np.isfinite(seen).all(axis=1) & np.isfinite(noise).all(axis=(1, 2)))
    seen, noise = np.where(known[:, None], seen, 0.0), np.where(known[:, None, None], noise, 0.0)
    weight = np.ones(len(rows))
    for _ in range(REWEIGHTINGS):
        state, spread = _filtered_and_smoothed(steps, when, seen, noise, known, weight)
        off = seen - state[:, _POSITION]
        # The smoothed position has this observation in it; its own noise alone is the measure.
        squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(noise + _TINY), off)
        fits = (DEGREES_OF_FREEDOM + 2) / (DEGREES_OF_FREEDOM + squared)
        weight = np.where(known, np.minimum(fits, 1.0), 1.0)
    result.position_m[rows] = state[:, :2]
    result.velocity_m_s[rows] = state[:, 2:]
    result.covariance[rows] = spread[:, :2, :2]
    result.velocity_variance[rows] = (spread[:, 2, 2] + spread[:, 3, 3]) / 2
    result.weight[rows] = weight


_TINY = 1e-12 * np.eye(2)
_EYE = np.eye(4)


@dataclass(frozen=True, slots=True)
class _Steps:
    """The rows of the k-th observations: those of the first `count[k]` tracks."""

    first: IntArray  # (tracks,) where each track begins
    count: IntArray  # (steps,)

    @classmethod
    def of(cls, lengths: IntArray) -> _Steps:
        first = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        longer = np.arange(lengths.max())
        return cls(first, len(lengths) - np.searchsorted(lengths[::-1], longer, side="right"))

    def rows(self, step: int, count: int | None = None) -> IntArray:
        return self.first[: self.count[step] if count is None else count] + step

    def __len__(self) -> int:
        return len(self.count)


def _filtered_and_smoothed(
    steps: _Steps,
    time_s: FloatArray,
    seen: FloatArray,
    noise: FloatArray,
    known: npt.NDArray[np.bool_],
    weight: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return smoothed states, (n, 4), and covariances, (n, 4, 4)."""
    count = len(time_s)
    state, spread = np.zeros((count, 4)), np.zeros((count, 4, 4))
    ahead, ahead_spread = np.zeros((count, 4)), np.zeros((count, 4, 4))
    start = np.diag([FAR_M**2, FAR_M**2, SPEED_STD_M_S**2, SPEED_STD_M_S**2])
    noise = noise / weight[:, None, None]
    move, driven = _motion(np.diff(time_s, prepend=time_s[0]))  # to each row from the one before it
    moved = move.swapaxes(1, 2)
    for step in range(len(steps)):
        rows = steps.rows(step)
        if step == 0:
            x, p = np.zeros((len(rows), 4)), np.broadcast_to(start, (len(rows), 4, 4))
            x[:, :2] = seen[rows]
        else:
            x = np.einsum("nij,nj->ni", move[rows], state[rows - 1])
            p = move[rows] @ spread[rows - 1] @ moved[rows] + driven[rows]
        ahead[rows], ahead_spread[rows] = x, p
        r = noise[rows]
        gain = p[:, :, :2] @ np.linalg.inv(p[:, :2, :2] + r)
        gain = np.where(known[rows, None, None], gain, 0.0)
        state[rows] = x + np.einsum("nij,nj->ni", gain, seen[rows] - x[:, :2])
        kept = np.broadcast_to(_EYE, p.shape).copy()
        kept[:, :, :2] -= gain
        # Joseph's form stays positive where noise is tiny beside what was known.
        spread[rows] = kept @ p @ kept.swapaxes(1, 2) + gain @ r @ gain.swapaxes(1, 2)
    # What a row takes back from the next one, for all rows at once; a track's last takes nothing.
    back = np.zeros((count, 4, 4))
    back[:-1] = spread[:-1] @ moved[1:] @ np.linalg.inv(ahead_spread[1:])
    turned = back.swapaxes(1, 2)
    for step in range(len(steps) - 2, -1, -1):
        rows = steps.rows(step, int(steps.count[step + 1]))
        gain, after = back[rows], rows + 1
        state[rows] += np.einsum("nij,nj->ni", gain, state[after] - ahead[after])
        spread[rows] += gain @ (spread[after] - ahead_spread[after]) @ turned[rows]
    return state, spread


def _motion(elapsed_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return transition and process noise over each time, (n, 4, 4) each."""
    dt = np.maximum(elapsed_s, 1e-6)
    move = np.broadcast_to(np.eye(4), (len(dt), 4, 4)).copy()
    move[:, 0, 2] = move[:, 1, 3] = dt
    driven = np.zeros((len(dt), 4, 4))
    for place, speed in ((0, 2), (1, 3)):
        driven[:, place, place] = dt**3 / 3
        driven[:, place, speed] = driven[:, speed, place] = dt**2 / 2
        driven[:, speed, speed] = dt
    return move, driven * ACCELERATION_DENSITY
