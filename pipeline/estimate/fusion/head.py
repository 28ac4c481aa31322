"""The head as a ruler: where its ray meets the level of the track's own height above the ground.

It carries the position where the feet are hidden, and adds to it where they are not. A box that is too
short for its track does not say which of its ends is missing: feet behind a wall, or a dark head before
a dark hedge. Each is a place, and where the frames before and after lead says which is likelier.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane
from pipeline.core.robust import finite
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.quality import AgainstTrack
from pipeline.estimate.by_track import median_by
from pipeline.estimate.fusion.kalman import ACCELERATION_DENSITY, SPEED_STD_M_S
from pipeline.estimate.gait import GAIT_STD_M
from pipeline.estimate.types import BoolArray, Estimated, Measured

# The head says nothing of the place where the camera is hardly above it.
MIN_ABOVE_HEAD_M = 0.3
FAR = 4.0  # standard deviations: farther from the way is not less likely, but something else


def use_head(
    fused: Estimated,
    geometry: Geometry,
    plane: GroundPlane,
    ground: Estimated,
    track: AgainstTrack,
) -> tuple[Estimated, BoolArray]:
    """Bring in the depth at which the head is as high as the track's own height.

    Returns:
        The estimates with it, and where the height is that of the track's other frames, (n,).
    """
    m = geometry.measured
    tall_m, tall_std_m, off = track.height_m, track.height_std_m, track.off
    hidden, crowded = track.hidden | m.truncated[:, 3], track.crowded

    depth_m, head_noise_m, per_height = _head_depth(geometry, plane, tall_m)
    # The height was measured with the pose of this camera, and the feet of these frames: what those
    # have in common is in it.
    relative = np.nan_to_num(
        median_by(m.track_id, finite(ground.depth_common_std_m / ground.depth_m))
    )
    head_common_m = np.hypot(per_height * tall_std_m, relative * depth_m)
    known = np.isfinite(depth_m) & ~m.truncated[:, 1] & ~crowded
    own_noise_m = fused.depth_noise_m
    foot_noise_m = np.where(hidden, np.inf, np.nan_to_num(own_noise_m, nan=np.inf))
    foot_noise_m = np.where(crowded, foot_noise_m * np.maximum(off, 1.0), foot_noise_m)
    with np.errstate(invalid="ignore", divide="ignore"):
        head = np.where(known, 1.0 / head_noise_m**2, 0.0)
        foot = np.where(np.isfinite(foot_noise_m), 1.0 / np.maximum(foot_noise_m, 1e-9) ** 2, 0.0)
    both = (head + foot) > 0
    share = np.where(both, head / np.where(both, head + foot, 1.0), 0.0)
    mixed_noise = np.where(both, 1.0 / np.sqrt(np.where(both, head + foot, 1.0)), np.nan)
    either = known & hidden & np.isfinite(fused.depth_m) & ~m.truncated[:, 3]
    by_head = _likelier_head(
        m, fused.depth_m, own_noise_m, depth_m, head_noise_m, ~(hidden | crowded)
    )
    share = np.where(either, by_head, share)
    apart_m = np.sqrt(by_head * (1 - by_head)) * np.abs(depth_m - fused.depth_m)
    within_m = np.sqrt(by_head * head_noise_m**2 + (1 - by_head) * own_noise_m**2)
    mixed_noise = np.where(either, np.hypot(within_m, apart_m), mixed_noise)
    take = both & (share > 0)
    mixed = np.where(
        share >= 1, depth_m, share * np.nan_to_num(depth_m) + (1 - share) * fused.depth_m
    )
    common = np.where(
        share >= 1, head_common_m, share * head_common_m + (1 - share) * fused.depth_common_std_m
    )
    depth_common_m = np.where(take, common, fused.depth_common_std_m)
    wide = np.where(take, mixed_noise, np.where(np.isfinite(foot_noise_m), foot_noise_m, np.nan))
    # The height there is that of the other frames.
    put_in = take & (hidden | (share >= 1))
    seen = np.isfinite(ground.height_m)
    of_track_m = np.nan_to_num(
        median_by(m.track_id, finite(np.where(seen, ground.height_common_std_m, np.nan)))
    )
    height_std_m = np.where(put_in, np.hypot(tall_std_m, of_track_m), fused.height_std_m)
    moved = replace(
        fused,
        depth_m=np.where(take, mixed, fused.depth_m),
        depth_common_std_m=depth_common_m,
        depth_std_m=np.where(np.isfinite(wide), np.hypot(wide, depth_common_m), fused.depth_std_m),
        height_m=np.where(put_in, tall_m, fused.height_m),
        height_std_m=height_std_m,
        height_common_std_m=np.where(
            put_in, height_std_m, np.nan_to_num(fused.height_common_std_m)
        ),
        height_assumed=fused.height_assumed | put_in,
    )
    return moved, np.asarray(put_in & np.isfinite(tall_m))


def _likelier_head(
    m: Measured,
    foot_m: FloatArray,
    foot_noise_m: FloatArray,
    head_m: FloatArray,
    head_noise_m: FloatArray,
    sound: BoolArray,
) -> FloatArray:
    """Return how likely it is that the feet are missing rather than the head, (n,).

    By how far each place is from the way between the nearest sound frames before and after.
    """
    way_m, way_std_m = _way(m, np.where(sound, foot_m, np.nan), foot_noise_m)
    log = np.zeros((2, len(m)))
    for row, (place_m, noise_m) in zip(
        log, ((foot_m, foot_noise_m), (head_m, head_noise_m)), strict=True
    ):
        std_m = np.hypot(noise_m, way_std_m)
        with np.errstate(invalid="ignore", divide="ignore"):
            row[:] = -0.5 * np.minimum(((place_m - way_m) / std_m) ** 2, FAR**2) - np.log(std_m)
    odds = np.where(np.isfinite(log).all(axis=0), log[0] - log[1], 0.0)
    return np.asarray(1.0 / (1.0 + np.exp(odds)))


def _way(m: Measured, depth_m: FloatArray, noise_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the depth on the straight way between the nearest known frames, and its deviation, (n,).

    A random walk of the velocity of density q strays from the straight line between two places a time
    L apart by a variance of q L^3 s^2 (1 - s)^2 / 3 at the share s of it (from the Green's function of
    the second derivative). Before the first place and after the last, by what somebody walks meanwhile.
    """
    order = np.lexsort((m.capture_time_ns, m.track_id))
    track, time_s = m.track_id[order], m.capture_time_ns[order] / 1e9
    known = np.isfinite(depth_m[order])
    count = len(order)
    at = np.arange(count)
    before = np.maximum.accumulate(np.where(known, at, -1))
    after = np.minimum.accumulate(np.where(known, at, count)[::-1])[::-1]
    is_before = (before >= 0) & (track[before] == track)
    after_at = np.minimum(after, count - 1)
    is_after = (after < count) & (track[after_at] == track)
    before = np.where(is_before, before, after_at)
    after = np.where(is_after, after_at, before)
    span_s = time_s[after] - time_s[before]
    part = np.where(span_s > 0, (time_s - time_s[before]) / np.where(span_s > 0, span_s, 1.0), 0.0)
    place_m, own_m = depth_m[order], noise_m[order]
    way_m = (1 - part) * place_m[before] + part * place_m[after]
    strayed_m2 = ACCELERATION_DENSITY * span_s**3 * (part * (1 - part)) ** 2 / 3
    beyond_s = np.where(is_before & is_after, 0.0, np.abs(time_s - time_s[before]))
    ends_m2 = ((1 - part) * own_m[before]) ** 2 + (part * own_m[after]) ** 2
    std_m = np.sqrt(ends_m2 + strayed_m2 + (SPEED_STD_M_S * beyond_s) ** 2)
    either = is_before | is_after
    result = np.full((2, count), np.nan)
    result[0, order], result[1, order] = np.where(either, way_m, np.nan), std_m
    return result[0], result[1]


def _head_depth(
    geometry: Geometry, plane: GroundPlane, tall_m: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the foot's depth by the head's ray, its noise, and its change by the height.

    The head's ray meets the plane at height H: at Z_h = (h_c - H) / (y_h cos t + sin t) along the axis,
    Y = Z_h (cos t - y_h sin t) ahead; the foot below it is at Z = Y cos t + h_c sin t.
    """
    y_h, tilt = geometry.head[:, 1], plane.tilt_rad
    above_m = plane.camera_height_m - tall_m
    slope = y_h * np.cos(tilt) + np.sin(tilt)
    with np.errstate(invalid="ignore", divide="ignore"):
        usable = (above_m > MIN_ABOVE_HEAD_M) & (slope > 0)
        along_m = np.where(usable, above_m / np.where(usable, slope, 1.0), np.nan)
        ahead_m = along_m * (np.cos(tilt) - y_h * np.sin(tilt))
        per_height = ahead_m / above_m * np.cos(tilt)
        by_row = along_m**2 / above_m * np.cos(tilt)
    noise_m = np.hypot(by_row * geometry.head_std, per_height * GAIT_STD_M)
    depth_m = ahead_m * np.cos(tilt) + plane.camera_height_m * np.sin(tilt)
    return np.where(ahead_m > 0, depth_m, np.nan), noise_m, per_height
