"""Quality of the boxes of a track, by the scatter of its own height.

Somebody who walks over flat ground is as tall in one frame as in the next, so what a track's heights
by the ground scatter is what its boxes are off, and the gait. That tells two things of the boxes which
no single one can:

1. How much worse, or better, they are than they say. Boxes that hold part of a group, or part of a
   person, are off by much, and by something else in every frame; outlines drawn by hand by little.
2. How long an error lasts, and so how much averaging over frames helps.

What a whole track has in common does not show in it (shoes of the ground's colour; half of a pair,
all along). But boxes that are worse from frame to frame are worse as a whole: it is taken in proportion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from pipeline.core.arrays import FloatArray
from pipeline.estimate.boxes.error_correlation import CORRELATION_S
from pipeline.estimate.gait import GAIT_STD_M
from pipeline.estimate.types import Estimated, Measured

TAILS = 3.0  # standard deviations: more is hidden feet or a second person, and how much says little
# What is taken for known beforehand weighs as much as so many independent frames.
PRIOR_FRAMES = 4.0
# Longer than a stride, so that the gait averages out, and than a detector's errors mostly last.
BLOCK_S = 2.0
PRIOR_BLOCKS = 1.0
# A track that is shorter is worse than its boxes say, by the square: of rendered recordings, errors of
# tracks of 3 s are 1.5 times what they are stated to be, of 1.5 s three times. (A clip may be as short,
# and nobody lost.)
SHORT_S, WORST_SHORT = 3.0, 3.0
BEST, WORST = (
    0.03,
    25.0,
)  # of the ratio of variances: nobody's boxes are exact, and worse is useless
SHORTEST_S = 0.05


@dataclass(frozen=True, slots=True)
class Scatter:
    """Verdict on each observation by the scatter of its track, (n,) each."""

    ratio: FloatArray  # of the variance of the box's ends to what it was stated to be
    correlation_s: FloatArray  # time after which errors are independent


def scatter_of(m: Measured, ground: Estimated, swing_m: FloatArray) -> Scatter:
    """Return how the heights of each track scatter.

    Args:
        m: the observations.
        ground: their heights by the ground.
        swing_m: the part of the noise of these that is of the feet's swing, (n,).
    """
    noise_m2 = np.maximum(ground.height_std_m**2 - ground.height_common_std_m**2, 0.0)
    gait_m2 = swing_m**2 + GAIT_STD_M**2
    box_m2 = np.maximum(noise_m2 - swing_m**2, 1e-12)
    expected_m2 = box_m2 + gait_m2
    tall = pd.Series(np.where(np.isfinite(expected_m2), ground.height_m, np.nan))
    off: pd.Series[float] = (tall - tall.groupby(m.track_id).transform("median")) / np.sqrt(
        expected_m2
    )
    frame = pd.DataFrame(
        {
            "track_id": m.track_id,
            "time_s": (m.capture_time_ns - m.capture_time_ns.min(initial=0)) / 1e9,
            "off": off.clip(-TAILS, TAILS),
            "box": np.where(tall.notna(), box_m2 / expected_m2, np.nan),
        }
    )
    frame["square"] = frame["off"] ** 2
    tracks = frame.groupby("track_id", sort=True)
    of_track = tracks.agg(
        square=("square", "mean"),
        box=("box", "mean"),
        count=("off", "count"),
        time_s=("time_s", "count"),
    )
    step_s = tracks["time_s"].diff().groupby(frame["track_id"]).median()
    correlation_s = _correlation_s(frame, of_track["square"], step_s)
    independent = of_track["count"] * (step_s / correlation_s).clip(upper=1.0)
    # Less than stated is the box's alone, beside the gait; more may be either's.
    square, box = of_track["square"], of_track["box"]
    own = square.where(square > 1, (square - (1 - box)) / box)
    # A track is short where the detector lost somebody, or found what is nobody.
    prior = 1.0 + ((SHORT_S / (of_track["time_s"] * step_s)) ** 2).clip(upper=WORST_SHORT)
    ratio = PRIOR_FRAMES * prior + independent * own.clip(lower=0.0)
    ratio = ratio / (PRIOR_FRAMES + independent)
    ratio = ratio.clip(BEST, WORST).fillna(1.0)
    at = np.searchsorted(of_track.index.to_numpy(), m.track_id)
    return Scatter(ratio.to_numpy()[at], correlation_s.to_numpy()[at])


def _correlation_s(frame: pd.DataFrame, square: pd.Series, step_s: pd.Series) -> pd.Series:
    """Return the time after which the errors of each track are independent, by batch means.

    The mean over a block of length B has the variance of one frame times T / B, with T twice the
    integral of the autocorrelation (Law and Kelton, Simulation Modeling and Analysis, 9.5.3).
    """
    block = np.floor(frame["time_s"] / BLOCK_S)
    means = frame.groupby(["track_id", block], sort=True)["off"].agg(["mean", "count"])
    most = means["count"].groupby("track_id").transform("max")
    full = means["mean"].where(means["count"] * 2 > most)
    by_track = full.groupby("track_id", sort=True)
    blocks = by_track.count()
    found_s = BLOCK_S * by_track.var() / square.replace(0.0, np.nan)
    known = found_s.notna()
    weight = blocks.where(known, 0.0)
    total = (weight * found_s.fillna(0.0) + PRIOR_BLOCKS * CORRELATION_S) / (weight + PRIOR_BLOCKS)
    return total.clip(lower=np.maximum(step_s.fillna(SHORTEST_S), SHORTEST_S), upper=None)
