"""Time for which the errors of boxes last, and so the number of independent observations of a track."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.estimate.types import Measured

# Boxes repeat their error for as long as a pose is held, about half a step, and a detector's for as long
# as somebody has the same ground and light behind them. The motion detector's heights on 16 rendered
# cameras correlate by 0.37 after an eighth of a second, 0.3 after half, 0.25 after one, 0.12 after two:
# the time of independence, twice the integral of that, is 1.4 s; of true outlines 0.5 s. In
# between; where the pose is known a track's own heights tell it (`scatter`).
CORRELATION_S = 1.0
# What all boxes of a camera have in common, as a share of the height: by that those 16 differ.
BOX_COMMON_STD = 0.01


def independent_share(m: Measured, correlation_s: FloatArray | None = None) -> FloatArray:
    """Return the part of an independent observation that each one is, (n,): interval over that time.

    Args:
        m: the observations.
        correlation_s: the time, (n,), where their tracks tell it.
    """
    lasts_s = CORRELATION_S if correlation_s is None else correlation_s
    share = interval_s(m) / lasts_s
    return np.clip(np.where(np.isfinite(share), share, 1.0), 1e-3, 1.0)


def interval_s(m: Measured) -> FloatArray:
    """Return the usual time between the observations of each track, (n,); NaN of one that is alone."""
    order = np.lexsort((m.capture_time_ns, m.track_id))
    track, time_ns = m.track_id[order], m.capture_time_ns[order]
    step_s = np.diff(time_ns, prepend=0) / 1e9
    step_s[np.diff(track, prepend=-1) != 0] = np.nan
    interval = np.empty(len(track))
    interval[order] = (
        pd.Series(step_s).groupby(track).transform("median").to_numpy(dtype=np.float64)
    )
    return interval
