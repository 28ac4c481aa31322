"""What the methods that scale a size have in common: choosing a calibration, heights, positions."""

from __future__ import annotations

import numpy as np

from pipeline.config import Config
from pipeline.estimate.columns import BoolArray, Estimated
from pipeline.estimate.geometry import Geometry
from pipeline.optics.object_size import height_exact_m, height_exact_std_m
from pipeline.records import Calibration, Dimension, FloatArray, Method


def calibrations_for(config: Config, method: Method, camera: str) -> list[Calibration]:
    """Return the calibrations of a method for a camera, one a class and dimension.

    One that names the camera goes before one that is for any.
    """
    chosen: dict[tuple[str, Dimension], Calibration] = {}
    for calibration in config.calibration:
        key = (calibration.object_class, calibration.dimension)
        if calibration.method is method and calibration.camera in ("", camera):
            if key not in chosen or chosen[key].camera == "":
                chosen[key] = calibration
    return list(chosen.values())


def size_of(geometry: Geometry, dimension: Dimension) -> tuple[FloatArray, FloatArray]:
    """Return the size of the boxes on the sensor in mm, and its standard deviation."""
    if dimension is Dimension.WIDTH:
        return geometry.width_on_sensor_mm, geometry.width_std_mm
    return geometry.height_on_sensor_mm, geometry.height_std_mm


def put(
    estimated: Estimated,
    rows: BoolArray,
    depth_m: FloatArray,
    depth_std_m: FloatArray,
    calibration: Calibration,
    extrapolate: bool,
) -> None:
    """Enter depths of a calibration at `rows`, flagged where they leave its range.

    Outside the range the estimate stands, flagged, because what a calibration says a little beyond
    its range is still evidence; `extrapolate` only decides over f-numbers without an entry.
    """
    known = rows & np.isfinite(depth_m)
    estimated.depth_m[known] = depth_m[known]
    estimated.depth_std_m[known] = depth_std_m[known]
    estimated.calibration_id[known] = calibration.calibration_id
    low, high = calibration.depth_min_m, calibration.depth_max_m
    if np.isfinite(low) and np.isfinite(high):
        inside = (depth_m >= low) & (depth_m <= high)
        estimated.in_calibrated_range[known] = inside[known]


def add_heights(estimated: Estimated, geometry: Geometry) -> None:
    """Add heights by the exact magnification at the estimated depths (Eq. 11).

    With the focal length it is m = f / (d - f), the lens focused on the object; without it, the
    focal length in pixels, which a calibration gives, stands for v / p.
    """
    m = geometry.measured
    size_mm, size_std_mm = geometry.height_on_sensor_mm, geometry.height_std_mm
    depth_m, depth_std_m = estimated.depth_m, estimated.depth_std_m
    height_m = height_exact_m(size_mm, depth_m, m.focal_length_mm)
    std_m = height_exact_std_m(size_mm, size_std_mm, depth_m, depth_std_m, m.focal_length_mm)
    if m.intrinsics is not None:
        by_angle = np.where(geometry.height_cut, np.nan, geometry.foot[:, 1] - geometry.head[:, 1])
        angle_std = np.hypot(geometry.foot_std, geometry.head_std)
        missing = np.isnan(height_m)
        height_m = np.where(missing, depth_m * by_angle, height_m)
        by_angle_std_m = np.hypot(depth_std_m * by_angle, depth_m * angle_std)
        std_m = np.where(missing, by_angle_std_m, std_m)
    estimated.height_m, estimated.height_std_m = height_m, std_m


def add_positions(estimated: Estimated, geometry: Geometry) -> None:
    """Add range and position along the ray through the middle of the box, the pose being unknown."""
    middle = geometry.middle
    estimated.range_m = estimated.depth_m * np.sqrt(1.0 + (middle**2).sum(axis=1))
    estimated.x_m = estimated.depth_m * middle[:, 0]
    estimated.y_m = np.where(np.isnan(middle[:, 0]), np.nan, estimated.depth_m)
