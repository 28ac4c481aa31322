"""The paper's regression: depth = b0 + b1 / o (Eq. 17)."""

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
from pipeline.optics.object_size import depth_inverse_model_m, depth_inverse_model_std_m


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depths for the classes that have a fit of Eq. 17, and heights.

    The coefficients' errors count with their correlation where the calibration states it. Without,
    as if they were independent, which overstates: they pull against each other.
    """
    m = geometry.measured
    estimated = Estimated.unknown(len(m))
    for calibration in calibrations_for(config, CalibratedMethod.INVERSE, m.camera):
        rows = m.class_name == calibration.object_class
        b0_m, b1_m_mm = calibration.value("b0_m"), calibration.value("b1_m_mm")
        if not rows.any() or not np.isfinite(b0_m + b1_m_mm):
            continue
        o_mm, o_std_mm = size_of(geometry, calibration.dimension)
        depth_m = depth_inverse_model_m(o_mm, b0_m, b1_m_mm)
        depth_m = np.where(depth_m > 0, depth_m, np.nan)
        b0_std_m = np.nan_to_num(calibration.std_error("b0_m"))
        slope_std_m = np.nan_to_num(calibration.std_error("b1_m_mm")) / o_mm
        correlation = np.nan_to_num(calibration.value("b0_b1_correlation"))
        line_variance = b0_std_m**2 + slope_std_m**2 + 2 * correlation * b0_std_m * slope_std_m
        depths = Depths(
            depth_m,
            depth_inverse_model_std_m(o_mm, o_std_mm, b1_m_mm),
            np.sqrt(np.maximum(line_variance, 0.0) + spread_m(calibration, depth_m) ** 2),
            calibration.dimension,
        )
        estimated = put(estimated, rows, depths, calibration)
    return with_positions(with_heights(estimated, geometry), geometry)
