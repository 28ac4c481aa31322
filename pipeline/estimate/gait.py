"""Effect of walking on a person's height in the picture, and the height when standing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.estimate.types import BoolArray, Estimated, Measured

WALKER = "person"

# The head rises and falls by 46 mm from lowest to highest, twice a stride (Whittle, Gait Analysis:
# vertical excursion of the trunk): a sine of 16 mm standard deviation.
EXCURSION_M = 0.046
GAIT_STD_M = EXCURSION_M / 2 / 2**0.5
# At its highest, over the standing leg, a walker's head is about 1 cm below its height when standing
# still, since that knee stays bent; so on average it is by that and half the excursion lower.
STANCE_KNEE_M = 0.01
GAIT_DROP_M = STANCE_KNEE_M + EXCURSION_M / 2
# It differs by person and pace. The excursion is 27 mm at a slow walk and 48 mm at a fast one, and from
# person to person 5 to 9 mm (Orendurff et al. 2004, J. Rehabil. Res. Dev. 41, 829): 11 mm together, of
# which half counts; the knee is taken to be half as much more or less.
GAIT_DROP_STD_M = 0.0075
# Slower than this nobody walks: it is standing about (a slow walk is 0.8 m/s).
WALKING_FROM_M_S = 0.4


def walking(measured: Measured, speed_m_s: np.ndarray) -> BoolArray:
    """Return which observations, (n,), are of a track of a person who walks, by its median speed."""
    by_track = pd.DataFrame(
        {"speed_m_s": speed_m_s, "person": measured.class_name == WALKER}
    ).groupby(measured.track_id)
    fast = by_track["speed_m_s"].transform("median").to_numpy() > WALKING_FROM_M_S
    mostly = by_track["person"].transform("mean").to_numpy() > 0.5
    return np.asarray(fast & mostly)


def as_standing(
    measured: Measured, estimated: Estimated, speed_m_s: np.ndarray, put_in: BoolArray
) -> Estimated:
    """Return the heights of walkers as they are when standing, which is what a survey measures.

    The drop differs by person, and is common to a track; the rise and fall is each frame's own.

    Args:
        measured: the observations.
        estimated: heights as they are seen.
        speed_m_s: of each observation on the ground, (n,), NaN where it is unknown.
        put_in: where the height is that of a prior, which is of people who stand, (n,).
    """
    walks = walking(measured, speed_m_s) & ~put_in & np.isfinite(estimated.height_m)
    common_m = np.hypot(estimated.height_common_std_m, GAIT_DROP_STD_M)
    own_m = np.hypot(np.hypot(estimated.height_std_m, GAIT_DROP_STD_M), GAIT_STD_M)
    return replace(
        estimated,
        height_m=np.where(walks, estimated.height_m + GAIT_DROP_M, estimated.height_m),
        height_std_m=np.where(walks, own_m, estimated.height_std_m),
        height_common_std_m=np.where(walks, common_m, estimated.height_common_std_m),
    )
