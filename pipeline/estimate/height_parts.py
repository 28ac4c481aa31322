"""The parts of a track height's error: what all of its camera share, what is its own, and of what kinds.

A height's error is H (s . e) + own, with s the slopes over the unknowns of `core.records.Error` and e
their errors, of covariance C = F F'. Stored are a = H s F, six numbers, and the deviation of the own
part, so that of two heights var(H_i - H_j) = |a_i - a_j|^2 + own_i^2 + own_j^2.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray, IntArray
from pipeline.core.records import Error, JointErrors
from pipeline.core.robust import noise_part
from pipeline.estimate.gait import GAIT_DROP_STD_M
from pipeline.optics.silhouette import REACH_TRACK_STD

SHARES = ("scale", "camera", "boxes", "posture", "doubt")


def slopes_of_tracks(track_id: IntArray, slopes: FloatArray, wanted: IntArray) -> FloatArray:
    """Return the medians of the slopes of some tracks, (t, 10), NaN where nothing is known.

    Args:
        track_id: of each observation, (n,).
        slopes: of their heights, (n, 10), NaN where there is none.
        wanted: the tracks, (t,).
    """
    return pd.DataFrame(slopes).groupby(track_id).median().reindex(wanted).to_numpy()


def height_parts(
    joint: JointErrors,
    slopes: FloatArray,
    height_m: FloatArray,
    height_std_m: FloatArray,
    doubt_m: FloatArray,
) -> dict[str, object]:
    """Return the columns of `track_heights` that say what an error is made of.

    Args:
        joint: the covariance, in parts.
        slopes: of the tracks' heights, relative, (t, 10); NaN where no height was measured.
        height_m: their heights, (t,).
        height_std_m: deviations of these in all, (t,).
        doubt_m: parts of those that are there because a track may be no one person, (t,).
    """
    known = np.isfinite(slopes).all(axis=1) & np.isfinite(height_m) & (height_std_m > 0)
    in_metres = np.where(known[:, None], slopes * height_m[:, None], 0.0)
    loadings_m = in_metres @ joint.low_rank
    common_m = np.linalg.norm(loadings_m, axis=1)
    own_m = noise_part(noise_part(height_std_m, doubt_m), common_m)
    posture_m = np.minimum(
        np.hypot(GAIT_DROP_STD_M, np.abs(in_metres[:, Error.REACH]) * REACH_TRACK_STD), own_m
    )
    variances = {
        "scale": joint.variance_of(in_metres, joint.scale),
        "camera": joint.variance_of(in_metres, joint.camera),
        "boxes": joint.variance_of(in_metres, joint.boxes) + own_m**2 - posture_m**2,
        "posture": posture_m**2,
        "doubt": doubt_m**2,
    }
    total = sum(variances.values())
    columns: dict[str, object] = {
        f"{name}_share": np.where(known, variances[name] / np.where(known, total, 1.0), np.nan)
        for name in SHARES
    }
    columns["own_std_m"] = np.where(known, own_m, np.nan)
    columns["common_loadings_m"] = [
        row.tolist() if is_known else None
        for row, is_known in zip(loadings_m, known.tolist(), strict=True)
    ]
    return columns


def unknown_parts(count: int) -> dict[str, object]:
    """Return the same columns where nothing is known of them."""
    columns: dict[str, object] = {f"{name}_share": np.full(count, np.nan) for name in SHARES}
    return columns | {"own_std_m": np.full(count, np.nan), "common_loadings_m": [None] * count}
