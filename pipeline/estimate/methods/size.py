"""Depth from the true size of an object: calibrated, or the prior of its class."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension
from pipeline.core.config import Config, SizePrior
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods.scaling import (
    Depths,
    angle_of,
    calibrations_for,
    put,
    size_of,
    spread_m,
    tilt_and_focal,
    with_heights,
    with_positions,
)
from pipeline.estimate.turned import shares_of
from pipeline.estimate.types import BoolArray, Estimated
from pipeline.optics.object_size import depth_from_size_m, depth_from_size_std_m

# A camera of unknown pose that watches people is level or looks down on them; surveillance
# cameras are tilted by 5-45 degrees, hand-held and tripod ones by little. Uniform over this range.
UNKNOWN_TILT_RAD = (0.0, math.radians(30.0))


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depth = v W / o for classes with a calibrated size, else from the class's prior.

    With a prior on height the height is assumed, not measured: it is the prior's mean, and marked.
    """
    m = geometry.measured
    estimated = Estimated.unknown(len(m))
    calibrated = np.zeros(len(m), dtype=np.bool_)
    for calibration in calibrations_for(config, CalibratedMethod.SIZE, m.camera):
        rows = m.class_name == calibration.object_class
        if rows.any() and calibration.value("object_size_m") > 0:
            estimated = put(estimated, rows, _by_calibration(geometry, calibration), calibration)
            calibrated |= rows
    assumed: list[tuple[SizePrior, BoolArray]] = []
    for prior in config.size_prior:
        rows = (m.class_name == prior.object_class) & ~calibrated
        if not rows.any():
            continue
        before_m = estimated.depth_m
        estimated = put(estimated, rows, _by_prior(geometry, prior, config))
        changed = rows & (estimated.depth_m != before_m) & np.isfinite(estimated.depth_m)
        assumed.append((prior, changed & estimated.height_assumed))
    estimated = with_heights(estimated, geometry)
    for prior, rows in assumed:
        std_m = prior.any_std_m
        estimated = replace(
            estimated,
            height_m=np.where(rows, prior.mean_m, estimated.height_m),
            height_std_m=np.where(rows, std_m, estimated.height_std_m),
            height_common_std_m=np.where(rows, std_m, estimated.height_common_std_m),
        )
    return with_positions(estimated, geometry)


def _by_calibration(geometry: Geometry, calibration: Calibration) -> Depths:
    """Scale by the lens data as in the calibration's own fit; by angles where they are unknown."""
    size_m = calibration.value("object_size_m")
    size_std_m = np.nan_to_num(calibration.std_error("object_size_m"))
    o_mm, o_std_mm = size_of(geometry, calibration.dimension)
    angle, angle_std = angle_of(geometry, calibration.dimension)
    by_lens_m = depth_from_size_m(size_m, o_mm, geometry.image_distance_mm)
    lensless = np.isnan(by_lens_m)
    depth_m = np.where(lensless, _over(size_m, angle), by_lens_m)
    relative = np.where(lensless, _over(angle_std, angle), _over(o_std_mm, o_mm))
    common_m = np.hypot(depth_m * size_std_m / size_m, spread_m(calibration, depth_m))
    common_m = np.where(lensless, np.hypot(common_m, depth_m * _focal_std(geometry)), common_m)
    return Depths(depth_m, depth_m * relative, common_m, calibration.dimension)


def _by_prior(geometry: Geometry, prior: SizePrior, config: Config) -> Depths:
    """Scale by angles. What is upright is foreshortened by the tilt; a width is not."""
    if prior.dimension is Dimension.HEIGHT:
        return _standing(geometry, prior, *_tilt_moments(geometry, config))
    angle, angle_std = angle_of(geometry, prior.dimension)
    depth_m = _over(prior.mean_m, angle)
    noise_m = depth_from_size_std_m(depth_m, angle, angle_std)
    relative = math.hypot(prior.any_std_m / prior.mean_m, _focal_std(geometry))
    share = shares_of(geometry.measured, config.estimate, prior.dimension)
    if share is None:
        return Depths(depth_m, noise_m, depth_m * relative, prior.dimension)
    depth_m, noise_m = depth_m / share.mean, noise_m / share.mean
    common_m = depth_m * np.hypot(relative, share.std / share.mean)
    return Depths(depth_m, noise_m, common_m, prior.dimension)


def _focal_std(geometry: Geometry) -> float:
    """Return the relative deviation of a focal length that was found with the pose, else 0."""
    plane = geometry.measured.ground_plane
    found = None if plane is None else plane.focal_covariance
    return 0.0 if found is None else math.sqrt(found[3])


def _standing(geometry: Geometry, prior: SizePrior, mean: FloatArray, cov: FloatArray) -> Depths:
    """Return Z = H (cos t - y_h sin t) / (y_f - y_h), averaged over what is known of the tilt t.

    Z is linear in (cos t, sin t), so their means and covariance give its mean and variance exactly.
    Without intrinsics the head's direction is not known either, and is taken as the axis.
    """
    y_h = geometry.head[:, 1]
    foot_std, head_std = geometry.foot_std, geometry.head_std
    if geometry.measured.intrinsics is None:
        y_h = np.zeros(len(y_h))
        foot_std = head_std = geometry.height_angle_std / math.sqrt(2)
    per_m = _over(prior.mean_m, geometry.height_angle)
    across = mean[0] - y_h * mean[1]
    depth_m = np.where(across > 0, per_m * across, np.nan)
    variance = cov[0, 0] - 2 * y_h * cov[0, 1] + y_h**2 * cov[1, 1]
    tilt_m = per_m * np.sqrt(np.maximum(variance, 0.0))
    by_foot_m = depth_m * per_m / prior.mean_m
    noise_m = np.hypot(by_foot_m * foot_std, (by_foot_m - per_m * mean[1]) * head_std)
    plane = geometry.measured.ground_plane
    if plane is not None and plane.focal_covariance is not None:
        by_tilt_m = -per_m * (mean[1] + y_h * mean[0])
        tilt_m = np.sqrt(tilt_and_focal(by_tilt_m, per_m * mean[0], plane))
    common_m = np.hypot(depth_m * prior.any_std_m / prior.mean_m, tilt_m)
    return Depths(depth_m, noise_m, common_m, Dimension.HEIGHT)


def _tilt_moments(geometry: Geometry, config: Config) -> tuple[FloatArray, FloatArray]:
    """Return the mean, (2,), and covariance, (2, 2), of (cos t, sin t).

    The tilt is the pose's, or the camera file's, else anything in `UNKNOWN_TILT_RAD`.
    """
    plane = geometry.measured.ground_plane
    camera = config.camera_named(geometry.measured.camera)
    if plane is not None:
        tilt, std = plane.tilt_rad, math.sqrt(plane.covariance[1, 1])
    else:
        tilt, std = math.radians(camera.tilt_deg), math.radians(camera.tilt_std_deg)
    if math.isfinite(tilt):
        slope = np.array([-math.sin(tilt), math.cos(tilt)])
        return np.array([math.cos(tilt), math.sin(tilt)]), np.outer(slope, slope) * std**2
    low, high = UNKNOWN_TILT_RAD
    tilts = low + (high - low) * (np.arange(1000) + 0.5) / 1000
    both = np.stack([np.cos(tilts), np.sin(tilts)])
    return both.mean(axis=1), np.cov(both, bias=True)


def _over(above: FloatArray | float, below: FloatArray) -> FloatArray:
    """Return a quotient, NaN where the divisor is not positive."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(below > 0, above / below, np.nan)
