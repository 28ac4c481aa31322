"""The paper's method: depth from aperture, k and the size on the sensor (Eq. 16)."""

from __future__ import annotations

import numpy as np

from pipeline.config import Config
from pipeline.estimate.columns import Estimated
from pipeline.estimate.common import add_heights, add_positions, calibrations_for, put, size_of
from pipeline.estimate.geometry import Geometry
from pipeline.optics.aperture_size import equivalent_object_size_m, interpolate_k
from pipeline.optics.object_size import depth_from_size_m, depth_from_size_std_m
from pipeline.records import Method


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depth = v (10 k a_R) / o for the classes that have a k, and heights.

    This is Eq. 16 with the lens focused at infinity (v = f). For a nearer focus the object size
    that k stands for is kept, and v follows the focus.
    """
    m = geometry.measured
    estimated = Estimated(len(m))
    for calibration in calibrations_for(config, Method.APERTURE, m.camera):
        f_numbers, k, k_std = calibration.by_f_number("k")
        if len(k) == 0:
            continue
        extrapolate = config.estimate.extrapolate
        k_at = interpolate_k(m.f_number, f_numbers, k, extrapolate=extrapolate)
        k_std_at = np.interp(m.f_number, f_numbers, np.nan_to_num(k_std))
        size_mm, size_std_mm = size_of(geometry, calibration.dimension)
        object_size_m = equivalent_object_size_m(k_at, m.focal_length_mm, m.f_number)
        depth_m = depth_from_size_m(object_size_m, size_mm, geometry.image_distance_mm)
        std_m = np.hypot(
            depth_from_size_std_m(depth_m, size_mm, size_std_mm, k_at, k_std_at),
            np.nan_to_num(calibration.residual_std_m),
        )
        rows = m.class_name == calibration.object_class
        put(estimated, rows, depth_m, std_m, calibration, extrapolate)
    add_heights(estimated, geometry)
    add_positions(estimated, geometry)
    return estimated
