"""Statistics of groups, at each of their members."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.core.arrays import FloatArray


def median_by(group: npt.NDArray[np.generic], values: FloatArray) -> FloatArray:
    """Return the median of what is known (not NaN) in each one's group, (n,); NaN where nothing is."""
    median = pd.Series(values).groupby(group).transform("median")
    return np.asarray(median, dtype=np.float64)
