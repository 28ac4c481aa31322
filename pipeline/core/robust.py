"""Statistics that a few bad values do not spoil, and how deviations are split."""

from __future__ import annotations

import math

import numpy as np

from pipeline.core.arrays import FloatArray

# Turns a median absolute deviation into a standard deviation: 1 / Phi^-1(3/4) of the normal distribution.
MAD_TO_STD = 1.4826
# The median of normal errors has a variance pi / 2 times that of the mean.
MEDIAN_EFFICIENCY = math.pi / 2


def noise_part(std: FloatArray, common_std: FloatArray) -> FloatArray:
    """Return the part of standard deviations that is not common, (n,): the root of std^2 - common^2."""
    return np.asarray(np.sqrt(np.maximum(std**2 - common_std**2, 0.0)))


def finite(values: FloatArray) -> FloatArray:
    """Return values, NaN where they are infinite, (n,)."""
    return np.where(np.isfinite(values), values, np.nan)
