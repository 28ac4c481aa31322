"""Doubt that a track is of one person, and all of it, by the height that it seems to have.

A box may hold half of somebody, or two, all along a track; nothing in it scatters then. But few people
are 1.3 m tall, or 2 m. So a height is taken for one of two things: that of somebody from the population,
with the error that is stated; or of a box that is off by tens of centimetres at one of its ends. The
farther a height is from the population's, the likelier it is the latter, and as much of it is in doubt.
The estimate stays what was measured; a child is none the shorter for being unusual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import Dimension
from pipeline.core.config import SizePrior
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.quality import AgainstTrack
from pipeline.estimate.by_track import median_by
from pipeline.estimate.types import Estimated

# Of tracks whose boxes scatter as much as they say, one in 25 holds parts or several for most of its
# time, of those that scatter more, more; their heights are off by 0.3 m (the motion detector's tracks in
# 24 rendered recordings: 3 % of those with a ratio of variances below 1.4, 15 % below 2, 25 % above).
BAD_SHARE, MOST_SHARE, BAD_STD_M = 0.04, 0.25, 0.3
# Whose box is wider than that is not likely one person: a stride across the view is 0.75 m and a shoe,
# and that only half of the time. The odds grow by e for each step beyond (same recordings: tenfold at
# 1.05 m).
WIDE_M, WIDE_STEP_M = 0.8, 0.1
# Half of a 95 % interval in standard deviations, and what is outside.
HALF_WIDTH, OUTSIDE, BISECTIONS = 1.96, 0.05, 12
DEGREES_OF_FREEDOM = 4.0  # of Student's t: children walk about among adults, too


def with_doubt(
    geometry: Geometry, ground: Estimated, track: AgainstTrack, priors: Sequence[SizePrior]
) -> Estimated:
    """Return what the ground says, widened for tracks that may be no one person.

    Args:
        geometry: the boxes.
        ground: the estimates by the ground.
        track: the height of each track.
        priors: of the classes that are known.
    """
    m = geometry.measured
    doubt_m = np.zeros(len(m))
    seen = np.isfinite(ground.height_m)
    common_m = median_by(m.track_id, np.where(seen, ground.height_common_std_m, np.nan))
    ratio = geometry.scatter.ratio if geometry.scatter is not None else np.ones(len(m))
    bad = _bad_share(ratio, median_by(m.track_id, geometry.width_angle * ground.depth_m))
    for prior in priors:
        if prior.dimension is not Dimension.HEIGHT:
            continue
        off_m = track.height_m - prior.walking_mean_m
        std_m = np.hypot(track.height_std_m, common_m)
        _, first, back = np.unique(m.track_id, return_index=True, return_inverse=True)
        of_class = doubtful_m(off_m[first], std_m[first], prior.std_m, bad[first])[back]
        doubt_m = np.where(m.class_name == prior.object_class, of_class, doubt_m)
    doubt_m = np.nan_to_num(doubt_m)
    widened = replace(
        ground,
        height_doubt_m=doubt_m,
        height_common_std_m=np.hypot(ground.height_common_std_m, doubt_m),
        height_std_m=np.hypot(ground.height_std_m, doubt_m),
    )
    plane = m.ground_plane
    if plane is None:
        return widened
    # If it is the lower end that is off, its ray passes so far above the ground and meets it beyond.
    farther = ground.y_m * np.cos(plane.tilt_rad) / plane.camera_height_m
    depth_doubt_m = np.nan_to_num(doubt_m * farther)
    return replace(
        widened,
        depth_common_std_m=np.hypot(ground.depth_common_std_m, depth_doubt_m),
        depth_std_m=np.hypot(ground.depth_std_m, depth_doubt_m),
    )


def _bad_share(ratio: FloatArray, width_m: FloatArray) -> FloatArray:
    """Return how often what scatters and is wide like this is no one person, (n,)."""
    share = np.minimum(BAD_SHARE * ratio**2, MOST_SHARE)
    wider = np.clip((np.nan_to_num(width_m) - WIDE_M) / WIDE_STEP_M, 0.0, 2.5)
    odds = share / (1 - share) * np.exp(wider)
    return np.asarray(odds / (1 + odds))


def doubtful_m(
    off_m: FloatArray, std_m: FloatArray, spread_m: float, bad_share: FloatArray
) -> FloatArray:
    """Return what widens the stated deviation of a height so that its 95 % interval is one, (n,).

    The error is normal with that deviation, or, with the odds that the height gives, that of a bad one.
    The interval that holds 95 % of the mixture is found by bisection.

    Args:
        off_m: the height less the population's mean.
        std_m: its stated deviation.
        spread_m: of the population.
        bad_share: how often a height is off by BAD_STD_M instead.
    """
    good_m, bad_m = np.hypot(std_m, spread_m), np.hypot(spread_m, BAD_STD_M)
    tails = (DEGREES_OF_FREEDOM + 1) / 2
    good = (1 + (off_m / good_m) ** 2 / DEGREES_OF_FREEDOM) ** -tails * 0.375 / good_m
    bad = np.exp(-0.5 * (off_m / bad_m) ** 2) / np.sqrt(2 * np.pi) / bad_m
    likely = bad_share * bad / (bad_share * bad + (1 - bad_share) * good)
    # What is known of a bad height's error: the part of its distance that is not the population's.
    share = (BAD_STD_M / bad_m) ** 2
    middle_m, own_m = share * np.abs(off_m), np.hypot(np.sqrt(share) * spread_m, std_m)
    low, high = HALF_WIDTH * std_m, HALF_WIDTH * (std_m + own_m) + middle_m
    for _ in range(BISECTIONS):
        half = (low + high) / 2
        outside = (1 - likely) * 2 * ndtr(-half / std_m) + likely * (
            ndtr((middle_m - half) / own_m) + ndtr((-middle_m - half) / own_m)
        )
        low, high = np.where(outside > OUTSIDE, half, low), np.where(outside > OUTSIDE, high, half)
    return np.sqrt(np.maximum((low / HALF_WIDTH) ** 2 - std_m**2, 0.0))
