"""Choice of the side of the plane of focus that an object is on: blur alone does not tell it.

A track keeps its side until its blur vanishes or the focus changes: such a stretch has one side. It is
found, in this order, by: blur that is wider than anything behind the plane of focus could have; the depth
by size or ground; the object's own size, which is the same on all stretches of a track, and at all
distances of one. What none of these tells, stays open.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.types import BoolArray, Estimated
from pipeline.optics.defocus import dioptres

# A side is chosen where it is this many times as likely as the other: 20 to 1.
LIKELIER = np.log(20.0)
# Errors of neighbouring frames are much the same: only so many of a stretch count as witnesses.
WITNESSES = 4
# Errors of an object's size in the picture beside those of its box: it turns, and its box with it.
SIZE_SCATTER = 0.03


@dataclass(frozen=True, slots=True)
class Sides:
    """Depths before and behind the plane of focus, (n,) each."""

    near_m: FloatArray
    far_m: FloatArray  # NaN where there is none
    std_per_m: FloatArray  # of 1 / depth
    not_far: BoolArray  # whether it is blurred by more than anything behind can be


def choose(sides: Sides, geometry: Geometry, others: Mapping[str, Estimated]) -> IntArray:
    """Return 1 for the near side, -1 for the far one, 0 where it is not known, (n,)."""
    m = geometry.measured
    stretch = _stretches(geometry, np.isfinite(sides.near_m))
    certain = pd.Series(sides.not_far).groupby(stretch).transform("any").to_numpy()
    infinite = dioptres(m.focus_distance_m) == 0
    score = np.where(certain | infinite, np.inf, 0.0)
    score += _of_stretch(_by_depth(sides, others), stretch)
    score = np.where(np.isnan(sides.near_m), 0.0, score)
    own = _own_size(sides, geometry)
    for _ in range(2):  # what the first round learned of the object's size decides the rest
        open_ = np.abs(score) < LIKELIER
        score = np.where(
            open_, score + _of_stretch(_by_size(own, score, m.track_id), stretch), score
        )
    open_ = np.abs(score) < LIKELIER
    score = np.where(open_, score + _by_constancy(own, sides, open_, stretch), score)
    # A far side that is not there is not chosen; near focus it may be missing by chance.
    score = np.where((score < 0) & np.isnan(sides.far_m), 0.0, score)
    near, far = score >= LIKELIER, score <= -LIKELIER
    return np.asarray(near.astype(np.int64) - far.astype(np.int64))


def _stretches(geometry: Geometry, resolved: BoolArray) -> IntArray:
    """Return the number of the stretch of each observation, (n,)."""
    m = geometry.measured
    frame = pd.DataFrame(
        {
            "track": m.track_id,
            "time": m.capture_time_ns,
            "focus": dioptres(m.focus_distance_m),
            "sharp": np.isfinite(np.asarray(m.blur_sigma_px)) & ~resolved,
        }
    ).sort_values(["track", "time"])
    key = frame[["track", "focus", "sharp"]]
    number = key.ne(key.shift()).any(axis=1).cumsum()
    return np.asarray(number.reindex(np.arange(len(m))), dtype=np.int64)


def _by_depth(sides: Sides, others: Mapping[str, Estimated]) -> FloatArray:
    """Return how much likelier the near side is by another method's depth: half the difference of z^2."""
    result = np.full(len(sides.near_m), np.nan)
    for other in others.values():
        with np.errstate(invalid="ignore", divide="ignore"):
            # A depth beyond a third of itself is no bell in 1/d: its interval is taken at its far end.
            std = other.depth_std_m / (other.depth_m * np.maximum(
                other.depth_m - other.depth_std_m, other.depth_m / 3
            ))  # fmt: skip
            unsure = np.hypot(sides.std_per_m, std)
            near = (1 / sides.near_m - 1 / other.depth_m) / unsure
            far = (1 / sides.far_m - 1 / other.depth_m) / unsure
        # What contradicts both sides is no witness for either.
        fits = np.fmin(np.abs(near), np.abs(far)) < 3
        mine = np.where(fits, (far**2 - near**2) / 2, np.nan)
        surer = np.isnan(result) | (np.abs(mine) > np.abs(result))
        result = np.where(np.isfinite(mine) & surer, mine, result)
    return result


def _of_stretch(score: FloatArray, stretch: IntArray) -> FloatArray:
    """Return the median of a stretch, once: its frames err alike."""
    median = pd.Series(score).groupby(stretch).transform("median")
    return np.nan_to_num(median.to_numpy(dtype=np.float64))


@dataclass(frozen=True, slots=True)
class _Sizes:
    """The logarithm of the object's true size on either side, and its deviation, (n,) each."""

    near: FloatArray
    far: FloatArray
    near_std: FloatArray
    far_std: FloatArray


def _own_size(sides: Sides, geometry: Geometry) -> _Sizes:
    angle = np.where(np.isnan(geometry.height_angle), geometry.width_angle, geometry.height_angle)
    std = np.where(
        np.isnan(geometry.height_angle), geometry.width_angle_std, geometry.height_angle_std
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(angle / geometry.image_distance_mm)  # v goes with the focus
        box = np.hypot(std / angle, SIZE_SCATTER)
        return _Sizes(
            log + np.log(sides.near_m),
            log + np.log(sides.far_m),
            np.hypot(box, sides.near_m * sides.std_per_m),
            np.hypot(box, sides.far_m * sides.std_per_m),
        )


def _by_size(own: _Sizes, score: FloatArray, track_id: IntArray) -> FloatArray:
    """Return how much likelier the near side is by the size that the track's known stretches give."""
    near, far = score >= LIKELIER, score <= -LIKELIER
    size = np.where(near, own.near, np.where(far, own.far, np.nan))
    std = np.where(near, own.near_std, np.where(far, own.far_std, np.nan))
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(np.isfinite(size) & (std > 0), 1 / std**2, 0.0)
    frame = pd.DataFrame({"w": weight, "wx": weight * np.nan_to_num(size), "n": weight > 0})
    sums = frame.groupby(track_id).transform("sum")
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (sums["wx"] / sums["w"]).to_numpy()
        error = np.sqrt(np.minimum(sums["n"], 1e9) / WITNESSES / sums["w"]).to_numpy()
        z_near = (own.near - mean) / np.hypot(own.near_std, error)
        z_far = (own.far - mean) / np.hypot(own.far_std, error)
        fits = np.fmin(np.abs(z_near), np.abs(z_far)) < 3
    return np.where(fits, (z_far**2 - z_near**2) / 2, np.nan)


def _by_constancy(own: _Sizes, sides: Sides, open_: BoolArray, stretch: IntArray) -> FloatArray:
    """Return how much likelier the near side is as the object keeps its size along the stretch."""

    def misfit(size: FloatArray, std: FloatArray) -> FloatArray:
        frame = pd.DataFrame({"x": np.where(open_, size, np.nan), "v": std**2})
        groups = frame.groupby(stretch)
        spread = groups["x"].transform("var").to_numpy(dtype=np.float64)
        return spread / groups["v"].transform("median").to_numpy(dtype=np.float64)

    with np.errstate(invalid="ignore", divide="ignore"):
        count = pd.Series(np.isfinite(sides.far_m)).groupby(stretch).transform("sum").to_numpy()
        free = np.minimum(np.maximum(count - 1, 0), WITNESSES)
        better = free * (misfit(own.far, own.far_std) - misfit(own.near, own.near_std)) / 2
    return np.nan_to_num(better)
