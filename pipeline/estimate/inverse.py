"""The paper's regression: depth = b0 + b1 / o (Eq. 17)."""

from __future__ import annotations

import numpy as np

from pipeline.config import Config
from pipeline.estimate.columns import Estimated
from pipeline.estimate.common import add_heights, add_positions, calibrations_for, put, size_of
from pipeline.estimate.geometry import Geometry
from pipeline.optics.object_size import depth_inverse_model_m, depth_inverse_model_std_m
from pipeline.records import Method


def estimate(geometry: Geometry, config: Config) -> Estimated:
    """Return depths for the classes that have a fit of Eq. 17, and heights."""
    m = geometry.measured
    estimated = Estimated(len(m))
    for calibration in calibrations_for(config, Method.INVERSE, m.camera):
        b0_m, b1_m_mm = calibration.value("b0_m"), calibration.value("b1_m_mm")
        size_mm, size_std_mm = size_of(geometry, calibration.dimension)
        depth_m = depth_inverse_model_m(size_mm, b0_m, b1_m_mm)
        residual_m = np.nan_to_num(calibration.residual_std_m)
        std_m = depth_inverse_model_std_m(size_mm, size_std_mm, b1_m_mm, residual_m)
        rows = m.class_name == calibration.object_class
        put(estimated, rows, depth_m, std_m, calibration, config.estimate.extrapolate)
    add_heights(estimated, geometry)
    add_positions(estimated, geometry)
    return estimated
