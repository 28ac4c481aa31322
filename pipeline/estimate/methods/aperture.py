"""The paper's method: depth from aperture, k and the size on the sensor (Eq. 16)."""

from __future__ import annotations

import numpy as np

from pipeline.core.calibration import CalibratedMethod
from pipeline.core.config import Config
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.methods.scaling import (
    Depths,
    calibrations_for,
    put,
    size_of,
    spread_m,
    with_heights,
    with_positions,
)
from pipeline.estimate.types import Estimated
from pipeline.optics.aperture_size import equivalent_object_size_m, interpolate_k
from pipeline.optics.object_size import depth_from_size_m, depth_from_size_std_m


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depth = v (10 k a_R) / o for the classes that have a k, and heights.

    This is Eq. 16 with the lens focused at infinity (v = f). For a nearer focus the object size
    that k stands for is kept, and v follows the focus. Outside the f-numbers of the table there is
    no estimate, unless the configuration says to extrapolate; then it is flagged.
    """
    m = geometry.measured
    estimated = Estimated.unknown(len(m))
    for calibration in calibrations_for(config, CalibratedMethod.APERTURE, m.camera):
        n, k, k_std = calibration.by_f_number("k")
        rows = m.class_name == calibration.object_class
        if len(k) == 0 or not rows.any():
            continue
        k_at = interpolate_k(m.f_number, n, k, extrapolate=config.estimate.extrapolate)
        relative_std = interpolate_k(m.f_number, n, np.nan_to_num(k_std), extrapolate=True) / k_at
        o_mm, o_std_mm = size_of(geometry, calibration.dimension)
        size_m = equivalent_object_size_m(k_at, m.focal_length_mm, m.f_number)
        depth_m = depth_from_size_m(size_m, o_mm, geometry.image_distance_mm)
        depths = Depths(
            depth_m,
            depth_from_size_std_m(depth_m, o_mm, o_std_mm),
            np.hypot(depth_m * relative_std, spread_m(calibration, depth_m)),
            calibration.dimension,
        )
        estimated = put(
            estimated, rows, depths, calibration, (m.f_number >= n[0]) & (m.f_number <= n[-1])
        )
    return with_positions(with_heights(estimated, geometry), geometry)
