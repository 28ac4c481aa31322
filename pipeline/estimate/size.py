"""Depth from the true size of an object: calibrated, or the prior of its class."""

from __future__ import annotations

import numpy as np

from pipeline.config import Config, SizePrior
from pipeline.estimate.columns import BoolArray, Estimated
from pipeline.estimate.common import add_heights, add_positions, calibrations_for, put, size_of
from pipeline.estimate.geometry import Geometry
from pipeline.optics.ground_plane import depth_from_height_m, ground_position_m, range_m
from pipeline.optics.object_size import depth_from_size_m, depth_from_size_std_m
from pipeline.records import Dimension, FloatArray, Method

# A camera of unknown pose that watches people is level or looks down on them; DESIGN's surveillance
# cameras are tilted by 5-45 degrees, hand-held and tripod ones by little. Uniform over this range.
UNKNOWN_TILT_RAD = np.deg2rad(np.linspace(0.0, 30.0, 13))


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depth = v W / o for classes with a calibrated size, else from the class's prior.

    With a prior on height the height is assumed, not measured: it is the prior's mean, and marked.
    """
    m = geometry.measured
    estimated = Estimated(len(m))
    calibrated = np.zeros(len(m), dtype=np.bool_)
    for calibration in calibrations_for(config, Method.SIZE, m.camera):
        size_m = calibration.value("object_size_m")
        size_std_m = np.nan_to_num(calibration.std_error("object_size_m"))
        size_mm, size_std_mm = size_of(geometry, calibration.dimension)
        depth_m = depth_from_size_m(size_m, size_mm, geometry.image_distance_mm)
        std_m = np.hypot(
            depth_from_size_std_m(depth_m, size_mm, size_std_mm, size_m, size_std_m),
            np.nan_to_num(calibration.residual_std_m),
        )
        rows = m.class_name == calibration.object_class
        put(estimated, rows, depth_m, std_m, calibration, config.estimate.extrapolate)
        calibrated |= rows
    add_heights(estimated, geometry)
    add_positions(estimated, geometry)
    for prior in config.size_prior:
        rows = (m.class_name == prior.object_class) & ~calibrated
        if rows.any() and prior.dimension is Dimension.HEIGHT:
            _from_height_prior(estimated, geometry, prior, rows)
    return estimated


def _from_height_prior(
    estimated: Estimated, geometry: Geometry, prior: SizePrior, rows: BoolArray
) -> None:
    plane = geometry.measured.ground_plane
    y_f, y_h = geometry.foot[:, 1], geometry.head[:, 1]
    tilts = UNKNOWN_TILT_RAD if plane is None else np.array([plane.tilt_rad])
    with np.errstate(invalid="ignore", divide="ignore"):
        by_tilt = depth_from_height_m(prior.mean_m, y_f[:, None], y_h[:, None], tilts)
        depth_m = by_tilt.mean(axis=1)
        relative = np.sqrt(
            (prior.std_m / prior.mean_m) ** 2
            + _edge_variance(geometry) / (y_f - y_h) ** 2
            + (by_tilt.std(axis=1) / depth_m) ** 2
        )
    good = rows & np.isfinite(depth_m) & ~geometry.height_cut
    estimated.depth_m[good] = depth_m[good]
    estimated.depth_std_m[good] = (depth_m * relative)[good]
    estimated.height_m[good] = prior.mean_m
    estimated.height_std_m[good] = prior.std_m
    estimated.height_common_std_m[good] = prior.std_m
    estimated.height_assumed[good] = True
    middle = geometry.middle
    estimated.range_m[good] = (depth_m * np.sqrt(1.0 + (middle**2).sum(axis=1)))[good]
    estimated.x_m[good] = (depth_m * middle[:, 0])[good]
    estimated.y_m[good] = depth_m[good]
    if plane is not None:
        x_m, y_m = ground_position_m(depth_m, geometry.foot[:, 0], y_f, plane.tilt_rad)
        away_m = range_m(x_m, y_m, plane.camera_height_m, prior.mean_m / 2)
        for name, values in (("x_m", x_m), ("y_m", y_m), ("range_m", away_m)):
            getattr(estimated, name)[good] = values[good]


def _edge_variance(geometry: Geometry) -> FloatArray:
    return geometry.foot_std**2 + geometry.head_std**2
