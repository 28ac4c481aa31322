"""Tracklets joined into tracks by one assignment over all of their ends.

What can be one person's is judged by place (each end drawn on to the other's time, and back), by height
for the place, and by colour; all of it in squares of deviations, so that it adds up. The assignment of
ends to beginnings of least cost is found by the Hungarian method (Zhang, Li and Nevatia 2008, Global Data
Association for Multi-Object Tracking Using Network Flows, CVPR, with the flow's unit capacities).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pipeline.core.arrays import BoolArray, FloatArray, IntArray

LONGEST_GAP_S = 2.0  # as long as a walker is behind a van or a tree (`TrackConfig.coast_s`)
END_S = 1.0  # of a tracklet's end tell its speed
# What a foot is off a straight way: the box's own error of two ends, and by the time between, for people
# turn, stop and set off (0.6 body heights a second squared, `kalman.ACCELERATION_STD`).
PLACE_STD, PLACE_STD_PER_S = 0.18, 0.35  # body heights
UNKNOWN_SPEED = (
    3.0  # times as far, of an end too short to tell its speed, with a walker's 0.8 a second
)
FARTHEST, FARTHEST_PER_S = 0.4, 1.6  # body heights: nobody gets farther
HEIGHT_STD = 0.10  # of the logarithm of the height beside what is usual there
# Colours of one person in two places, and of two people, differ by this: the mean of 1 minus the
# Bhattacharyya coefficient of the histograms.
COLOUR_STD = 0.12
COLOUR_WEIGHT = 3.0  # in squared deviations at COLOUR_STD
WAIT_COST_PER_S = 0.5
# The tracker's own word that a piece goes on as the next piece of its track: it is right at seven or
# eight of such cuts for one at which it is not, and twice the logarithm of that adds up with squared
# deviations.
TRACKERS_WORD = 4.0
# A link that costs more is none: so many squared deviations, of place, height and colour.
NO_LINK = 8.0
# Of the height: a child, half of a person or two in one box, which are to tell nothing of the others.
UNUSUAL, FIT_STEPS = 0.15, 5
TRUSTED = 10  # observations: of fewer, height and colour count less


@dataclass(frozen=True, slots=True)
class Ends:
    """One end of each tracklet: a structure of t-long arrays."""

    time_s: FloatArray
    foot_px: FloatArray  # (t, 2)
    speed_px_s: FloatArray  # (t, 2) of the foot; 0 where it cannot be told
    sure: BoolArray  # whether the speed is told
    tall_px: FloatArray


@dataclass(frozen=True, slots=True)
class Tracklets:
    """Facts of each tracklet that links are judged by: a structure of t-long arrays."""

    begin: Ends
    end: Ends
    track: IntArray  # of the tracker
    count: IntArray  # observations
    height: FloatArray  # logarithm of the height beside the usual one there
    colour: FloatArray  # (t, c) square roots of a histogram; NaN where nobody looked


def describe(
    tracklet: IntArray,
    track: IntArray,
    time_s: FloatArray,
    bbox_xyxy_px: FloatArray,
    colour: FloatArray,
) -> Tracklets:
    """Return what `link` asks of tracklets.

    Args:
        tracklet: of each box, from 0, ascending; rows of one are in order of time, and those of one track
            of the tracker one after another.
        track: of the tracker, (n,).
        time_s: when.
        bbox_xyxy_px: where, (n, 4).
        colour: square roots of a histogram, (n, c); NaN where nobody looked.
    """
    count = np.bincount(tracklet)
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    last = first + count - 1
    box = bbox_xyxy_px
    foot = np.stack([(box[:, 0] + box[:, 2]) / 2, box[:, 3]], axis=1)
    tall = np.maximum(box[:, 3] - box[:, 1], 1e-6)
    off = np.log(tall) - np.log(_usual_height(foot, tall, count[tracklet]))
    looked = np.isfinite(colour).all(axis=1)
    sums = np.zeros((len(count), colour.shape[1]))
    np.add.at(sums, tracklet[looked], colour[looked])
    looks = np.bincount(tracklet[looked], minlength=len(count))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = sums / looks[:, None]
    return Tracklets(
        _ends(tracklet, time_s, foot, tall, first),
        _ends(tracklet, time_s, foot, tall, last),
        track[first],
        count,
        np.bincount(tracklet, weights=off) / count,
        mean,
    )


def _ends(
    tracklet: IntArray, time_s: FloatArray, foot: FloatArray, tall: FloatArray, at: IntArray
) -> Ends:
    """Return the ends at rows `at`, (t,): a line through the foot's places within `END_S`."""
    total = len(at)
    since = time_s - time_s[at][tracklet]
    near = np.abs(since) <= END_S
    row, d = tracklet[near], since[near]
    n, s1, s2 = (np.bincount(row, weights=d**k, minlength=total) for k in range(3))
    spread = s2 - s1**2 / n
    mean = s1 / n
    lasts = np.abs(d).max(initial=0.0) > 0
    known = (n >= 3) & (np.sqrt(np.maximum(spread, 0) / n) > 0.08) if lasts else n < 0
    speed, place = np.zeros((total, 2)), foot[at].copy()
    for axis in range(2):
        y = foot[near, axis]
        y_mean = np.bincount(row, weights=y, minlength=total) / n
        slope = np.bincount(row, weights=d * y, minlength=total) - n * mean * y_mean
        slope = np.where(known, slope / np.where(known, spread, 1.0), 0.0)
        speed[:, axis] = slope
        place[:, axis] = np.where(known, y_mean - slope * mean, y_mean)
    height = np.bincount(row, weights=tall[near], minlength=total) / n
    return Ends(time_s[at], place, speed, np.asarray(known), height)


def _usual_height(foot: FloatArray, tall: FloatArray, weight: IntArray) -> FloatArray:
    """Return the usual height at each foot, (n,): linear in the place, which it is on flat ground.

    (Of people of one height; `pipeline.optics.ground_plane`.) Without such a plane, the median.
    """
    base = np.column_stack([np.ones(len(foot)), foot - foot.mean(axis=0)])
    w = np.minimum(weight, TRUSTED) / TRUSTED / tall
    usual: FloatArray = tall
    for _ in range(FIT_STEPS):
        usual = base @ np.linalg.lstsq(base * w[:, None], tall * w, rcond=None)[0]
        off = np.abs(tall - usual) / tall
        w = np.minimum(weight, TRUSTED) / TRUSTED / tall / (1 + (off / UNUSUAL) ** 2)
    return np.asarray(np.where(usual > 0.25 * np.median(tall), usual, np.median(tall)))


def link(t: Tracklets, begun: BoolArray, ended: BoolArray) -> IntArray:
    """Return the tracklet that continues each one, (t,); -1 where none does.

    Args:
        t: the tracklets.
        begun: whether it is known already what a tracklet continues, or that it continues none, (t,).
        ended: whether it is known already which continues a tracklet, (t,).
    """
    one, other = _candidates(t)
    open_ = ~ended[one] & ~begun[other]
    one, other = one[open_], other[open_]
    cost = _cost(t, one, other)
    good = cost < NO_LINK
    one, other, cost = one[good], other[good], cost[good]
    follows = np.full(len(t.count), -1, dtype=np.int64)
    for rows in _apart(one, other, len(t.count)):
        a, i = np.unique(one[rows], return_inverse=True)
        b, j = np.unique(other[rows], return_inverse=True)
        # Beside the pairs, each end may stay alone, at the cost of no link.
        table = np.full((len(a), len(b) + len(a)), 4 * NO_LINK * (len(a) + 1), dtype=np.float64)
        table[i, j] = cost[rows]
        table[np.arange(len(a)), len(b) + np.arange(len(a))] = NO_LINK
        chosen, column = linear_sum_assignment(table)
        linked = column < len(b)
        follows[a[chosen[linked]]] = b[column[linked]]
    return follows


def _candidates(t: Tracklets) -> tuple[IntArray, IntArray]:
    """Return pairs of which the second begins after the first ends, but not too long after."""
    order = np.argsort(t.begin.time_s, kind="stable")
    begins = t.begin.time_s[order]
    low = np.searchsorted(begins, t.end.time_s, side="right")
    high = np.searchsorted(begins, t.end.time_s + LONGEST_GAP_S, side="right")
    one = np.repeat(np.arange(len(low)), high - low)
    offset = np.arange(len(one)) - np.repeat(np.cumsum(high - low) - (high - low), high - low)
    other = order[np.repeat(low, high - low) + offset]
    return one[one != other], other[one != other]


def _cost(t: Tracklets, one: IntArray, other: IntArray) -> FloatArray:
    """Return squared deviations of pairs of tracklets from being one person's, (p,)."""
    gap_s = (t.begin.time_s[other] - t.end.time_s[one])[:, None]
    tall = ((t.end.tall_px[one] + t.begin.tall_px[other]) / 2)[:, None]
    a, b = t.end.foot_px[one], t.begin.foot_px[other]
    direct = np.hypot(*((b - a) / tall).T)
    on = np.hypot(*((a + t.end.speed_px_s[one] * gap_s - b) / tall).T)
    back = np.hypot(*((b - t.begin.speed_px_s[other] * gap_s - a) / tall).T)
    gap_s = gap_s[:, 0]
    doubt = np.sqrt(
        np.where(t.end.sure[one], 1.0, UNKNOWN_SPEED)
        * np.where(t.begin.sure[other], 1.0, UNKNOWN_SPEED)
    )
    std = PLACE_STD + PLACE_STD_PER_S * gap_s * doubt
    # Who stood still goes the shorter way: none of both is worse than a step aside.
    on, back = np.minimum(on, 1.2 * direct), np.minimum(back, 1.2 * direct)
    place = (on**2 + back**2) / 2 / std**2
    weight = np.sqrt(np.minimum(t.count[one], TRUSTED) * np.minimum(t.count[other], TRUSTED))
    weight = weight / TRUSTED
    height = ((t.height[one] - t.height[other]) / HEIGHT_STD) ** 2
    likeness = np.minimum((t.colour[one] * t.colour[other]).sum(axis=1), 1.0)
    colour = np.nan_to_num(COLOUR_WEIGHT * (1.0 - likeness) / COLOUR_STD)
    own = (t.track[one] == t.track[other]) & (other == one + 1)
    cost = place + weight * (height + colour) + WAIT_COST_PER_S * gap_s - TRACKERS_WORD * own
    return np.asarray(np.where(direct <= FARTHEST + FARTHEST_PER_S * gap_s, cost, np.inf))


def _apart(one: IntArray, other: IntArray, count: int) -> list[IntArray]:
    """Return the pairs in groups that have no tracklet's end or beginning in common."""
    if not len(one):
        return []
    graph = coo_array((np.ones(len(one)), (one, count + other)), shape=(2 * count, 2 * count))
    _, part = connected_components(graph, directed=False)
    order = np.argsort(part[one], kind="stable")
    edges = np.flatnonzero(np.diff(part[one][order])) + 1
    return np.split(order, edges)
