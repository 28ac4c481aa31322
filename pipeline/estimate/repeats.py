"""How long the errors of boxes last, and so how many observations of a track are independent."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.estimate.columns import Measured
from pipeline.records import FloatArray

# Boxes repeat their error for as long as a pose is held, about half a step, and a detector's for as long
# as somebody has the same ground and light behind them. The motion detector's heights on 16 rendered
# cameras correlate by 0.37 after an eighth of a second, 0.3 after half, 0.25 after one, 0.12 after two:
# the time of independence, twice the integral of that, is 1.4 s; of true outlines 0.5 s. In between.
CORRELATION_S = 1.0
# What all boxes of a camera have in common, as a share of the height: by that those 16 differ.
BOX_COMMON_STD = 0.01


def independent_share(m: Measured) -> FloatArray:
    """Return the part of an independent observation that each one is, (n,): interval over that time."""
    order = np.lexsort((m.capture_time_ns, m.track_id))
    track, time_ns = m.track_id[order], m.capture_time_ns[order]
    step_s = np.diff(time_ns, prepend=0) / 1e9
    step_s[np.diff(track, prepend=-1) != 0] = np.nan
    by_track = pd.Series(step_s).groupby(track).transform("median").to_numpy(dtype=np.float64)
    share = np.empty(len(track))
    share[order] = np.clip(np.nan_to_num(by_track, nan=CORRELATION_S) / CORRELATION_S, 1e-3, 1.0)
    return share
