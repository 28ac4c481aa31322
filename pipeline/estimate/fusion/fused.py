"""The best of all methods: weighted by precision, checked against the track, smoothed along it.

1. Each observation's depths are weighted by their precision. Methods that read the same thing of the
   picture (aperture, inverse and size: one side of the box) have its error in common, so together they
   are no surer than each; and where they contradict each other, less sure. A method that contradicts the
   surest one all along a track (the size prior on a child) is left out of that track.
2. Where the pose is known, a track's height, from the frames that show all of it, is as good a ruler
   as the ground: the head's ray meets the level of the track's height above the ground. It carries the
   position where the feet are hidden, and adds to it where they are not. Whose height in a frame is too
   small for the track has hidden feet there; whose is too large is not alone in the box.
3. Positions are smoothed along the track. What frames have in common (the calibration's error) is not
   made smaller by that, and errors of boxes last as long as the track's heights say. They stay within
   what the methods say of the depth.
4. The height in a frame is that at the smoothed position (and then smoothed itself: `smooth_heights`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.core.records import GroundPlane
from pipeline.core.robust import noise_part
from pipeline.estimate.boxes.error_correlation import independent_share, interval_s
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.quality import AgainstTrack, Quality, against_track
from pipeline.estimate.fusion.head import use_head
from pipeline.estimate.fusion.smoother import smooth_tracks
from pipeline.estimate.gait import as_standing
from pipeline.estimate.methods import GROUND, method_named
from pipeline.estimate.types import BoolArray, Estimated, Measured
from pipeline.optics.ground_plane import ground_position_m, height_m, range_m

# A method is left out of a track where it is this many standard deviations from the surest one.
CONTRADICTION = 2.5
# How much of a person sways to either side of the middle of the box, in widths of the box.
SWAY = 0.1
# The time over which the swing of the feet averages out: twice the integral of its autocorrelation, which
# for what goes to and fro is nearly nil (outlines of the simulated walkers, blocks of two seconds).
SWING_S = 0.04
HALF_SHOULDERS_M = 0.25  # with an arm
# Ends of a box that something hides may be anywhere; that is no reason for a place beyond all methods'.
MOST_NOISE = 0.05  # of the depth


def estimate(
    geometry: Geometry, members: Mapping[str, Estimated], track: AgainstTrack | None = None
) -> Estimated:
    """Return the fused estimates; NaN where no method has a depth.

    Args:
        geometry: the boxes.
        members: what each method made of them, heights as they are seen.
        track: each observation beside its track; `beside_track` where it is left out.
    """
    m = geometry.measured
    if not members:
        return Estimated.unknown(len(m))
    fused = _weighted(m, members)
    plane = m.ground_plane
    if m.intrinsics is None:
        return fused
    of_prior = fused.height_assumed
    if plane is not None and GROUND in members:
        by_ground = members[GROUND]
        track = track or beside_track(geometry, by_ground)
        fused, by_track = use_head(fused, geometry, plane, by_ground, track)
        of_prior = of_prior & ~by_track
    bounds_m = _bounds(fused, members)
    fused = _smoothed(fused, geometry, plane, members.get(GROUND), bounds_m)
    if plane is not None:
        fused = _with_heights_on_ground(fused, geometry, plane, members)
    return as_standing(m, fused, fused.speed_m_s, of_prior)


def beside_track(
    geometry: Geometry, ground: Estimated, quality: Quality | None = None
) -> AgainstTrack:
    """Return the height of each observation by the ground beside that of its track."""
    return against_track(
        geometry.measured, ground.height_m, ground.height_noise_m, quality, lasts_s(geometry)
    )


def lasts_s(geometry: Geometry) -> FloatArray | None:
    """Return how long errors last, (n,), where that is known."""
    return None if geometry.scatter is None else geometry.scatter.correlation_s


def _weighted(m: Measured, members: Mapping[str, Estimated]) -> Estimated:
    """Return the mean of the methods by precision; heights by those that measure them."""
    parts = list(members.values())
    depth = np.stack([e.depth_m for e in parts])
    std = np.stack([e.depth_std_m for e in parts])
    common = np.stack([e.depth_common_std_m for e in parts])
    noise = noise_part(std, common)
    usable: BoolArray = np.asarray(np.isfinite(depth) & (std > 0))
    ground = members.get(GROUND)
    if ground is not None:
        # A height that was put in says how far away somebody is if they are as tall as people are. Of
        # that the pose knows already, by all who walked there; the ground is asked alone.
        assumed = np.stack([e.height_assumed for e in parts])
        usable = np.asarray(usable & ~(assumed & np.isfinite(ground.depth_m)))
    group = np.array([method_named(name).reads for name in members])
    names = sorted(set(group))
    within = _shares(np.where(usable, 1.0 / np.where(usable, std, 1.0) ** 2, 0.0), group)
    widened = _contradiction(depth, common, within, group)
    alike = [group == name for name in names]
    g_depth = np.stack([_sum(within[g], depth[g]) for g in alike])
    g_noise = np.stack([_sum(within[g], noise[g]) for g in alike])
    g_common = np.stack([_sum(within[g], (common * widened)[g]) for g in alike])
    g_std = np.hypot(g_noise, g_common)
    known = np.isfinite(g_std)
    known &= _agreeing(m, g_depth, g_std, known)
    weight = np.where(known, 1.0 / np.where(known, g_std, 1.0) ** 2, 0.0)
    between = _shares(weight)
    share = within * between[np.searchsorted(names, group)]
    # A depth without a deviation is exact, or its deviation unknown: it is taken as it is.
    alone = ~known.any(axis=0) & np.isfinite(depth).any(axis=0)
    first = np.argmax(np.isfinite(depth), axis=0)
    share[first[alone], np.flatnonzero(alone)] = 1.0
    # Methods that read different things are calibrated by different things as well.
    common_m = np.nan_to_num(_root_sum(between, g_common))
    noise_m = _root_sum(between, g_noise)
    noise_m[alone] = noise[first[alone], np.flatnonzero(alone)]
    common_m[alone] = common[first[alone], np.flatnonzero(alone)]
    ranges = np.stack([e.in_calibrated_range for e in parts])
    outside = ((ranges == 0) & (share > 0)).any(axis=0)
    stated = (np.isfinite(ranges) & (share > 0)).any(axis=0)
    fused = replace(
        Estimated.unknown(len(m)),
        depth_m=_sum(share, depth),
        depth_common_std_m=common_m,
        depth_std_m=np.hypot(noise_m, common_m),
        range_m=_sum(share, np.stack([e.range_m for e in parts])),
        x_m=_sum(share, np.stack([e.x_m for e in parts])),
        y_m=_sum(share, np.stack([e.y_m for e in parts])),
        in_calibrated_range=np.where(outside, 0.0, np.where(stated, 1.0, np.nan)),
    )
    return _with_heights(fused, parts, share, group, widened)


def _contradiction(
    depth: FloatArray, common: FloatArray, within: FloatArray, group: npt.NDArray[np.str_]
) -> FloatArray:
    """Return by how much the common deviations of methods that read the same are too small, (k, n).

    They see the same box, so nothing but their calibrations can set them apart: the scale factor of the
    Particle Data Group (Review of Particle Physics, unconstrained averaging), where it exceeds one.
    """
    wider = np.ones_like(depth)
    for name in sorted(set(group)):
        g = group == name
        used = within[g] > 0
        mean = _sum(within[g], depth[g])
        with np.errstate(invalid="ignore", divide="ignore"):
            squared = ((depth[g] - mean) / common[g]) ** 2
        squared = np.where(used & np.isfinite(squared), squared, 0.0).sum(axis=0)
        wider[g] = np.sqrt(np.maximum(squared / np.maximum(used.sum(axis=0) - 1, 1), 1.0))
    return wider


def _agreeing(m: Measured, depth: FloatArray, std: FloatArray, usable: BoolArray) -> BoolArray:
    """Return which methods, (methods, n), do not contradict the surest one along their track."""
    sure = np.where(usable, std, np.inf)
    best = np.argmin(sure, axis=0)
    columns = np.arange(depth.shape[1])
    with np.errstate(invalid="ignore"):
        off = (depth - depth[best, columns]) / np.hypot(std, std[best, columns])
    off[~usable] = np.nan
    typical = pd.DataFrame(off.T).groupby(m.track_id).transform("median").to_numpy().T
    return np.asarray(~(np.abs(typical) > CONTRADICTION) | (best == np.arange(len(depth))[:, None]))


def _with_heights(
    fused: Estimated,
    parts: list[Estimated],
    share: FloatArray,
    group: npt.NDArray[np.str_],
    widened: FloatArray,
) -> Estimated:
    """Return the estimates with heights.

    Those that were measured; one that was put in only where there is no other.
    """
    tall = np.stack([e.height_m for e in parts])
    std = np.stack([e.height_std_m for e in parts])
    common = np.stack([e.height_common_std_m for e in parts])
    noise = noise_part(std, common)
    common = common * widened
    std = np.hypot(noise, common)
    assumed = np.stack([e.height_assumed for e in parts])
    known = np.isfinite(tall) & (share > 0)
    measured = known & ~assumed
    none = np.asarray(~measured.any(axis=0))
    usable = np.where(none, known, measured)
    weight = np.where(usable, 1.0 / np.maximum(np.nan_to_num(std, nan=1.0), 1e-9) ** 2, 0.0)
    part = _shares(weight)
    common_m = np.nan_to_num(_root_sum_alike(part, common, group))
    return replace(
        fused,
        height_m=_sum(part, tall),
        height_common_std_m=common_m,
        height_std_m=np.hypot(_root_sum_alike(part, noise, group), common_m),
        height_assumed=np.asarray(none & known.any(axis=0)),
    )


def _shares(weight: FloatArray, group: npt.NDArray[np.str_] | None = None) -> FloatArray:
    """Return weights, (k, n), over their sum: of all, or of those of the same group."""
    if group is None:
        total = np.broadcast_to(weight.sum(axis=0), weight.shape)
    else:
        total = np.stack([weight[group == name].sum(axis=0) for name in group])
    return np.where(total > 0, weight / np.where(total > 0, total, 1.0), 0.0)


def _sum(share: FloatArray, values: FloatArray) -> FloatArray:
    """Return weighted sums over the methods, NaN where none has a share."""
    total = np.where(share > 0, share * values, 0.0).sum(axis=0)
    return np.where((share > 0).any(axis=0), total, np.nan)


def _root_sum(share: FloatArray, std: FloatArray) -> FloatArray:
    """Return the deviation of a weighted sum of what is independent."""
    return np.sqrt(_sum(share**2, std**2))


def _root_sum_alike(share: FloatArray, std: FloatArray, group: npt.NDArray[np.str_]) -> FloatArray:
    """Return the deviation of a weighted sum whose errors are the same in a group."""
    sums = [_sum(share[group == name], std[group == name]) for name in sorted(set(group))]
    known = np.isfinite(np.stack(sums))
    total = np.sqrt((np.nan_to_num(np.stack(sums)) ** 2).sum(axis=0))
    return np.where(known.any(axis=0), total, np.nan)


def _bounds(fused: Estimated, members: Mapping[str, Estimated]) -> tuple[FloatArray, FloatArray]:
    """Return between which depths each observation is by all that tells it, (n,) each.

    From the nearest to the farthest, and what the box itself may be off beyond.
    """
    told = [fused, *members.values()]
    depth_m = np.stack([np.where(e.depth_m > 0, e.depth_m, np.nan) for e in told])
    with np.errstate(invalid="ignore", divide="ignore"):
        noise = np.stack([e.depth_noise_m for e in told]) / depth_m
        room = np.exp(2 * np.minimum(np.nan_to_num(noise), MOST_NOISE))
    return np.fmin.reduce(depth_m / room), np.fmax.reduce(depth_m * room)


def _smoothed(
    fused: Estimated,
    geometry: Geometry,
    plane: GroundPlane | None,
    ground: Estimated | None,
    bounds_m: tuple[FloatArray, FloatArray],
) -> Estimated:
    """Return the estimates with positions smoothed along the tracks, within bounds of their depth.

    Depths, ranges and deviations follow from them. A track whose boxes are hardly trusted goes on as
    those that are; that alone does not carry anybody to where nothing in the picture says they are.
    """
    m = geometry.measured
    position, covariance = _positions(fused, geometry, plane)
    # Boxes repeat their errors; the swing of the feet about its mean does not, it comes back every step.
    share = independent_share(m, lasts_s(geometry))[:, None, None]
    stride = _stride(fused, geometry, plane, ground)
    lasting = (covariance - stride) / share
    inflated = lasting + stride
    time_s = (m.capture_time_ns - m.capture_time_ns.min(initial=0)) / 1e9
    smoothed = smooth_tracks(m.track_id, time_s, position, inflated)
    several = pd.Series(m.track_id).groupby(m.track_id).transform("count").to_numpy() > 1
    use = several & np.isfinite(smoothed.position_m).all(axis=1) & np.isfinite(position).any(axis=1)
    x_m, y_m = smoothed.position_m.T
    tilt = plane.tilt_rad if plane is not None else 0.0
    up_m = plane.camera_height_m if plane is not None else 0.0
    free_m = y_m * np.cos(tilt) + up_m * np.sin(tilt)
    depth_m = np.clip(free_m, *bounds_m)
    with np.errstate(invalid="ignore", divide="ignore"):
        x_m = x_m * np.where(free_m > 0, depth_m / free_m, 1.0)
    y_m = (depth_m - up_m * np.sin(tilt)) / np.cos(tilt)
    # As good as white noise to the smoother; but the swing comes back every step, and means less.
    swing = np.clip(SWING_S / interval_s(m), 0.0, 1.0)
    passed = (lasting + swing[:, None, None] * stride)[:, 1, 1] / inflated[:, 1, 1]
    noise_m = np.sqrt(smoothed.covariance[:, 1, 1] * passed) * np.cos(tilt)
    if geometry.scatter is None:
        noise_m *= _birge_ratio(m, fused, free_m)
    if plane is not None:
        half_m = np.nan_to_num(fused.height_m, nan=1.7) / 2
        away_m = range_m(x_m, y_m, up_m, half_m)
    else:
        away_m = np.sqrt(x_m**2 + y_m**2 + (depth_m * geometry.middle[:, 1]) ** 2)
    std_m = np.hypot(noise_m, fused.depth_common_std_m)
    return replace(
        fused,
        depth_m=np.where(use, depth_m, fused.depth_m),
        depth_std_m=np.where(use, std_m, fused.depth_std_m),
        x_m=np.where(use, x_m, fused.x_m),
        y_m=np.where(use, y_m, fused.y_m),
        speed_m_s=np.where(use, np.linalg.norm(smoothed.velocity_m_s, axis=1), np.nan),
        range_m=np.where(use, away_m, fused.range_m),
    )


def _birge_ratio(m: Measured, fused: Estimated, smooth_m: FloatArray) -> FloatArray:
    """Return by how much a track's depths scatter more than they say, (n,), at least one.

    Boxes of groups and of parts of people are worse than any one box can tell; beside their own track
    they show. Deviations that are too small for the scatter are scaled up to it (Birge 1932; the scale
    factor of the Review of Particle Physics).
    """
    noise_m = fused.depth_noise_m
    with np.errstate(invalid="ignore", divide="ignore"):
        square = ((fused.depth_m - smooth_m) / noise_m) ** 2
    known = pd.Series(np.where(np.isfinite(square), square, np.nan))
    mean = known.groupby(m.track_id).transform("mean").to_numpy(dtype=np.float64)
    return np.sqrt(np.maximum(np.nan_to_num(mean, nan=1.0), 1.0))


def _stride(
    fused: Estimated, geometry: Geometry, plane: GroundPlane | None, ground: Estimated | None
) -> FloatArray:
    """Return the covariance of the error that the feet's swing makes of the positions, (n, 2, 2)."""
    stride = np.zeros((len(geometry.measured), 2, 2))
    if plane is None or ground is None or geometry.reach_std is None:
        return stride
    of_all, of_foot = (
        np.nan_to_num(e.depth_std_m**2 - e.depth_common_std_m**2) for e in (fused, ground)
    )
    # The share that the foot has in the depth, the head having the rest.
    share = np.clip(of_all / np.maximum(of_foot, 1e-12), 0.0, 1.0)
    swing_m2 = np.minimum((share * geometry.reach_std * geometry.reach_m) ** 2, of_all)
    ahead = np.full(len(share), 1.0 / np.cos(plane.tilt_rad))
    along = np.column_stack([geometry.middle[:, 0], ahead])
    return np.asarray(swing_m2[:, None, None] * along[:, :, None] * along[:, None, :])


def _positions(
    fused: Estimated, geometry: Geometry, plane: GroundPlane | None
) -> tuple[FloatArray, FloatArray]:
    """Return where each observation is, (n, 2), and the covariance of its own error, (n, 2, 2).

    An error of depth moves it along the line of sight, an error of the box's middle across.
    """
    noise_m = fused.depth_noise_m
    tilt = plane.tilt_rad if plane is not None else 0.0
    x = geometry.middle[:, 0]
    if plane is not None:
        # On the ground the position follows from the depth; the row of the foot need not be seen.
        row = (plane.camera_height_m / fused.depth_m - np.sin(tilt)) / np.cos(tilt)
        x_m, y_m = ground_position_m(fused.depth_m, x, row, tilt)
        # The middle of the box is between foot and head, and the head is nearer: by H sin t.
        nearer = np.nan_to_num(fused.height_m) * np.sin(tilt) / fused.depth_m
        x_m = x_m * 2 * (1 - nearer) / (2 - nearer)
    else:
        x_m, y_m = fused.depth_m * x, fused.depth_m
    along = noise_m[:, None] * np.column_stack([x, np.full(len(x), 1.0 / np.cos(tilt))])
    across_m = fused.depth_m * SWAY * np.abs(geometry.width_angle)
    # A box that the picture cuts off at a side shows some part of a person, not their middle.
    across_m = np.nan_to_num(across_m, nan=HALF_SHOULDERS_M) + 1e-3
    covariance = along[:, :, None] * along[:, None, :]
    covariance[:, 0, 0] += across_m**2
    covariance[:, 1, 1] += 1e-6
    return np.column_stack([x_m, y_m]), covariance


def _with_heights_on_ground(
    fused: Estimated,
    geometry: Geometry,
    plane: GroundPlane,
    members: Mapping[str, Estimated],
) -> Estimated:
    """Return heights measured at the smoothed positions; only the head's row is the frame's own."""
    tilt, y_h = plane.tilt_rad, geometry.head[:, 1]
    y_f = (plane.camera_height_m / fused.depth_m - np.sin(tilt)) / np.cos(tilt)
    tall_m = height_m(fused.depth_m, y_f, y_h, tilt)
    ground = members.get(GROUND)
    seen = np.isfinite(tall_m) & ~geometry.measured.height_cut & ~fused.height_assumed
    if ground is not None:
        seen &= np.isfinite(ground.height_m)
    noise_m = fused.depth_noise_m
    across = np.cos(tilt) - y_h * np.sin(tilt)
    by_head_m = fused.y_m / across**2
    # Along the head's ray it is lower the farther away; a metre of depth is 1 / cos t on the ground.
    by_depth = np.abs(y_h * np.cos(tilt) + np.sin(tilt)) / (across * np.cos(tilt))
    noise_m = np.hypot(by_head_m * geometry.head_std, by_depth * noise_m)
    common_m = ground.height_common_std_m if ground is not None else fused.height_common_std_m
    std_m = np.hypot(noise_m, common_m)
    return replace(
        fused,
        height_m=np.where(seen, tall_m, fused.height_m),
        height_common_std_m=np.where(seen, common_m, fused.height_common_std_m),
        height_std_m=np.where(seen, std_m, fused.height_std_m),
    )
