"""Smoothed heights along tracks: a person takes a second to bend or sit down, the ends of a box jump.

A frame's height is its box's, and boxes of small silhouettes are off by a pixel, by more beside shadows
or where somebody passes behind. It is smoothed as positions are, a body being no quicker up and down than
over the ground. The height of the whole track is another number, of all of its frames (`tracks`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.estimate.boxes.error_correlation import independent_share
from pipeline.estimate.fusion.smoother import smooth_tracks
from pipeline.estimate.types import Estimated, Measured


def smooth_heights(m: Measured, fused: Estimated, lasts_s: FloatArray | None = None) -> Estimated:
    """Return the estimates with the heights that were measured smoothed along their tracks.

    What frames have in common is not made smaller by that, and errors of boxes last.

    Args:
        m: the observations.
        fused: heights of frames, those of walkers as when they stand.
        lasts_s: how long errors of boxes last, (n,), where that is known.
    """
    measured = np.isfinite(fused.height_m) & ~fused.height_assumed
    noise_m2 = np.maximum(fused.height_std_m**2 - fused.height_common_std_m**2, 0.0)
    noise_m2 = noise_m2 / independent_share(m, lasts_s)
    # The smoother takes positions on a plane; heights are the first coordinate, the second stands still.
    position = np.column_stack([np.where(measured, fused.height_m, np.nan), np.zeros(len(m))])
    covariance = np.zeros((len(m), 2, 2))
    covariance[:, 0, 0], covariance[:, 1, 1] = noise_m2, 1.0
    time_s = (m.capture_time_ns - m.capture_time_ns.min(initial=0)) / 1e9
    smoothed = smooth_tracks(m.track_id, time_s, position, covariance)
    height_m, variance_m2 = smoothed.position_m[:, 0], smoothed.covariance[:, 0, 0]
    use = measured & np.isfinite(height_m) & np.isfinite(noise_m2) & (noise_m2 > 0)
    std_m = np.sqrt(variance_m2 + fused.height_common_std_m**2)
    return replace(
        fused,
        height_m=np.where(use, height_m, fused.height_m),
        height_std_m=np.where(use, std_m, fused.height_std_m),
    )
