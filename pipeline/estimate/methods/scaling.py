"""Common parts of the methods that scale a size: choice of a calibration, heights, positions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension
from pipeline.core.config import Config
from pipeline.core.records import GroundPlane
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.types import BoolArray, Estimated
from pipeline.optics.ground_plane import ground_position_m, height_m, range_m
from pipeline.optics.object_size import height_exact_m


@dataclass(frozen=True, slots=True)
class Depths:
    """Depths of all observations of a camera by a calibration or a prior, (n,) each.

    The standard deviation comes in two parts: `noise_std_m` is the box's and differs from frame to
    frame, `common_std_m` is the calibration's or the object's own and is shared along a track.
    """

    depth_m: FloatArray
    noise_std_m: FloatArray
    common_std_m: FloatArray
    dimension: Dimension


def calibrations_for(config: Config, method: CalibratedMethod, camera: str) -> list[Calibration]:
    """Return the calibrations of a method for a camera, one a class and dimension.

    One that names the camera goes before one that is for any.
    """
    chosen: dict[tuple[str, Dimension], Calibration] = {}
    for calibration in config.calibration:
        key = (calibration.object_class, calibration.dimension)
        if calibration.method is not method or calibration.camera not in ("", camera):
            continue
        if key not in chosen or (chosen[key].camera == "" and calibration.camera):
            chosen[key] = calibration
    return list(chosen.values())


def size_of(geometry: Geometry, dimension: Dimension) -> tuple[FloatArray, FloatArray]:
    """Return the size of the boxes on the sensor in mm, and its standard deviation."""
    if dimension is Dimension.WIDTH:
        return geometry.width_on_sensor_mm, geometry.width_std_mm
    return geometry.height_on_sensor_mm, geometry.height_std_mm


def angle_of(geometry: Geometry, dimension: Dimension) -> tuple[FloatArray, FloatArray]:
    """Return the size of the boxes at unit distance, and its standard deviation."""
    if dimension is Dimension.WIDTH:
        return geometry.width_angle, geometry.width_angle_std
    return geometry.height_angle, geometry.height_angle_std


def spread_m(calibration: Calibration, depth_m: FloatArray) -> FloatArray:
    """Return the spread of depth about a fit: in proportion to depth where it was so fitted.

    It holds the box noise of the calibration's own observations too, so together with the box's
    deviation it errs on the wide side.
    """
    relative = calibration.value("residual_relative")
    if np.isfinite(relative):
        return np.asarray(depth_m * relative)
    return np.full(len(depth_m), np.nan_to_num(calibration.residual_std_m))


def put(
    estimated: Estimated,
    rows: BoolArray,
    depths: Depths,
    calibration: Calibration | None = None,
    in_table: BoolArray | None = None,
) -> Estimated:
    """Return the estimates with depths at `rows`, where those are known and surer than what stands there.

    Outside the calibration's depths the estimate stands, flagged: a little beyond its range a
    calibration is still evidence. `in_table` says whether the f-number was within its table.
    """
    depth_std_m = np.hypot(depths.noise_std_m, depths.common_std_m)
    with np.errstate(invalid="ignore"):
        better = np.isnan(estimated.depth_m) | (depth_std_m < estimated.depth_std_m)
    known = rows & np.isfinite(depths.depth_m) & better
    name = None if calibration is None else calibration.calibration_id
    in_range = _in_range(depths.depth_m, calibration, in_table)
    # The height in the picture went into the depth, so it cannot be measured by it again.
    by_height = depths.dimension is Dimension.HEIGHT
    return replace(
        estimated,
        depth_m=np.where(known, depths.depth_m, estimated.depth_m),
        depth_std_m=np.where(known, depth_std_m, estimated.depth_std_m),
        depth_common_std_m=np.where(known, depths.common_std_m, estimated.depth_common_std_m),
        height_assumed=np.where(known, by_height, estimated.height_assumed),
        in_calibrated_range=np.where(known, in_range, estimated.in_calibrated_range),
        calibration_id=np.where(known, np.array(name, dtype=np.object_), estimated.calibration_id),
    )


def _in_range(
    depth_m: FloatArray, calibration: Calibration | None, in_table: BoolArray | None
) -> FloatArray:
    """Return 1 where a calibration holds, 0 where it does not, NaN where it states no range, (n,)."""
    if calibration is None:
        return np.full(len(depth_m), np.nan)
    low, high = calibration.depth_min_m, calibration.depth_max_m
    if np.isfinite(low) and np.isfinite(high):
        inside = (depth_m >= low) & (depth_m <= high)
        return np.asarray(inside if in_table is None else inside & in_table, dtype=np.float64)
    if in_table is None:
        return np.full(len(depth_m), np.nan)
    return in_table.astype(np.float64)


def with_heights(estimated: Estimated, geometry: Geometry) -> Estimated:
    """Return estimates with heights at their depths, and standard deviations to first order.

    With the pose, of a vertical object standing on the ground (`optics.ground_plane`). Else H = o d / v
    (Eq. 11), upright before a level camera as in the paper: v from the focus distance where that is
    finite; else the lens is taken to be focused on the object, m = f / (d - f). Without a focal
    length the one in pixels stands for v / p.
    """
    m = geometry.measured
    depth_m = estimated.depth_m
    plane = m.ground_plane
    tilt_std_m: FloatArray | float = 0.0
    if plane is not None and m.intrinsics is not None:
        y_f, y_h, tilt = geometry.foot[:, 1], geometry.head[:, 1], plane.tilt_rad
        across = np.cos(tilt) - y_h * np.sin(tilt)
        tall_m = np.where(m.height_cut, np.nan, height_m(depth_m, y_f, y_h, tilt))
        by_foot_m = depth_m / across
        by_head_m = by_foot_m * (tall_m / depth_m * np.sin(tilt) - 1.0)
        noise_m = np.hypot(by_foot_m * geometry.foot_std, by_head_m * geometry.head_std)
        by_tilt_m = tall_m * (np.sin(tilt) + y_h * np.cos(tilt)) / across
        tilt_std_m = np.abs(by_tilt_m) * float(np.sqrt(plane.covariance[1, 1]))
        if plane.focal_covariance is not None:
            by_focal_m = -tall_m * np.cos(tilt) / across
            tilt_std_m = np.sqrt(tilt_and_focal(by_tilt_m, by_focal_m, plane))
        by_depth = tall_m / depth_m
    else:
        o_mm, o_std_mm = geometry.height_on_sensor_mm, geometry.height_std_mm
        f_mm = m.focal_length_mm
        on_object = ~np.isfinite(m.focus_distance_m)
        with np.errstate(invalid="ignore", divide="ignore"):
            at_focus_m = o_mm * depth_m / geometry.image_distance_mm
            tall_m = np.where(on_object, height_exact_m(o_mm, depth_m, f_mm), at_focus_m)
            by_depth = o_mm / np.where(on_object, f_mm, geometry.image_distance_mm)
            noise_m = tall_m * o_std_mm / o_mm
        angle, angle_std = geometry.height_angle, geometry.height_angle_std
        lensless = np.isnan(o_mm) | np.isnan(f_mm)
        tall_m = np.where(lensless, depth_m * angle, tall_m)
        by_depth = np.where(lensless, angle, by_depth)
        noise_m = np.where(lensless, depth_m * angle_std, noise_m)
    with np.errstate(invalid="ignore"):
        tall_m = np.where(tall_m > 0, tall_m, np.nan)
    assumed = estimated.height_assumed
    # Where the depth came from this same height in the picture, the box's error cancels.
    noise_m = np.where(assumed, 0.0, np.hypot(noise_m, by_depth * estimated.depth_noise_m))
    common_m = np.hypot(by_depth * estimated.depth_common_std_m, tilt_std_m)
    unknown = np.isnan(tall_m)
    return replace(
        estimated,
        height_m=tall_m,
        height_std_m=np.where(unknown, np.nan, np.hypot(noise_m, common_m)),
        height_common_std_m=np.where(unknown, 0.0, common_m),
    )


def pose_variance(by_pose: FloatArray, by_focal: FloatArray, plane: GroundPlane) -> FloatArray:
    """Return the variance, (n,), that comes of the pose, and of the lens if that was found with it.

    Args:
        by_pose: derivatives by camera height, tilt and roll, (n, 3).
        by_focal: by the logarithm of the focal length, (n,).
        plane: the pose.
    """
    of_pose = np.asarray(np.einsum("ni,ij,nj->n", by_pose, plane.covariance, by_pose))
    if plane.focal_covariance is None:
        return of_pose
    *shared, own = plane.focal_covariance
    return of_pose + 2 * by_focal * (by_pose @ np.array(shared)) + by_focal**2 * own


def tilt_and_focal(by_tilt: FloatArray, by_focal: FloatArray, plane: GroundPlane) -> FloatArray:
    """Return the variance of what depends on the pose by its tilt alone."""
    zero = np.zeros(len(by_tilt))
    return pose_variance(np.stack([zero, by_tilt, zero], axis=1), by_focal, plane)


def with_positions(estimated: Estimated, geometry: Geometry) -> Estimated:
    """Return estimates with the range to the middle of the box, and the position.

    With the pose the position is that of the foot on the ground (of the box's middle, where the
    feet are cut off); without it, along the ray through the middle of the box.
    """
    m = geometry.measured
    depth_m, middle = estimated.depth_m, geometry.middle
    away_m = depth_m * np.sqrt(1.0 + (middle**2).sum(axis=1))
    plane = m.ground_plane
    if plane is None or m.intrinsics is None:
        y_m = np.where(np.isnan(middle[:, 0]), np.nan, depth_m)
        return replace(estimated, range_m=away_m, x_m=depth_m * middle[:, 0], y_m=y_m)
    stands = ~m.truncated[:, 3]
    at = np.where(stands[:, None], geometry.foot, middle)
    x_m, y_m = ground_position_m(depth_m, at[:, 0], at[:, 1], plane.tilt_rad)
    on_ground = stands & np.isfinite(estimated.height_m)
    to_middle_m = range_m(x_m, y_m, plane.camera_height_m, estimated.height_m / 2)
    away_m = np.where(on_ground, to_middle_m, away_m)
    return replace(estimated, range_m=away_m, x_m=x_m, y_m=y_m)
