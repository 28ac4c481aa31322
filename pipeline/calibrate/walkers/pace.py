"""Pace of people, who walk as fast away from a camera as across its picture.

A focal length that is too long by a share makes ways along the axis too long by that share and leaves
those across as they are. Nobody's speed is known, and no mean of all is assumed; people's speeds differ,
but not by their direction. Of each track the speed is that of the straight line through its feet.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import OptimizeResult

from pipeline.calibrate.walkers.model import ABOVE, ROLL, TILT, Sample
from pipeline.core.arrays import FloatArray
from pipeline.optics.ground_plane import foot_depth_m, ground_position_m, remove_roll

# Pedestrians on the level walk at 1.34 m/s with a deviation of 0.26 (Weidmann 1993, Transporttechnik der
# Fussgaenger): 0.19; slow groups and those in a hurry, who are not normal deviates, widen it.
SPEED_STD = 0.22  # relative
MIN_SPAN_S = 1.0
# Who turns is faster than the line through the track; who stands has no speed.
MAX_BEND = 0.1  # robust spread about the line, of its length
# Who is soon out of the picture is not followed: where the way through the view is short, only the slow
# are seen, and people would seem slower that way. Ways are used that take the mean walker so long: one
# in a hurry, twice as fast, is still seen for a second and a half.
MIN_WAY_S = 3.0
MAX_NOISE = 0.2  # of the speed
IMPOSSIBLE = 30.0


@dataclass(frozen=True, slots=True)
class Pace:
    """The tracks whose speeds are compared, by number, and the deviation of each, relative."""

    track: npt.NDArray[np.intp]  # (k,)
    std: FloatArray  # (k,)

    def __len__(self) -> int:
        return len(self.track)

    def off(self, x: FloatArray, sample: Sample) -> FloatArray:
        """Return how far each speed is from the mean of all, in standard deviations, (k,)."""
        if not len(self):
            return np.empty(0)
        speed, _, _ = _speeds(x, sample)
        with np.errstate(divide="ignore", invalid="ignore"):
            log = np.log(speed[self.track])
        known = np.isfinite(log)
        weight = np.where(known, self.std**-2, 0.0)
        mean = (np.where(known, log, 0.0) * weight).sum() / max(weight.sum(), 1e-12)
        return np.where(known, (log - mean) / self.std, IMPOSSIBLE)


def pace_of(sample: Sample, fit: OptimizeResult | None) -> Pace:
    """Return the tracks to compare: those that were seen for long; by a fit, that went straight."""
    span = np.array([np.ptp(sample.time_s[sample.track == t]) for t in range(sample.people)])
    use = span > MIN_SPAN_S
    noise = np.zeros(sample.people)
    if fit is not None:
        by = float(np.exp(-fit.x[-1]))
        seen = replace(sample, foot=sample.foot * by, sigma=sample.sigma * by)
        speed, bend_m, std = _speeds(fit.x, seen)
        with np.errstate(divide="ignore", invalid="ignore"):
            noise = std / speed
            way_m = speed * span
            use &= (bend_m < MAX_BEND * way_m) & (noise < MAX_NOISE)
            use &= way_m > MIN_WAY_S * np.nanmedian(speed)
    use &= np.isfinite(noise)
    return Pace(np.flatnonzero(use), np.hypot(SPEED_STD, noise[use]))


def _speeds(x: FloatArray, sample: Sample) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return of each track the speed, how far it strays from a line, and the speed's deviation, (p,)."""
    above_m, tilt = np.exp(x[ABOVE]), x[TILT]
    foot = remove_roll(sample.foot, x[ROLL])
    z_m = foot_depth_m(above_m, tilt, foot[:, 1])
    at = np.stack(ground_position_m(z_m, foot[:, 0], foot[:, 1], tilt), axis=1)
    noise_m = z_m**2 / above_m * np.cos(tilt) * sample.sigma

    def mean(v: FloatArray) -> FloatArray:
        total = np.bincount(sample.track, sample.weight * v, sample.people)
        return total / np.bincount(sample.track, sample.weight, sample.people)

    t = sample.time_s - mean(sample.time_s)[sample.track]
    spread = mean(t**2)
    velocity = np.stack([mean(t * p) / spread for p in at.T], axis=1)
    middle = np.stack([mean(p) for p in at.T], axis=1)
    stray = at - middle[sample.track] - velocity[sample.track] * t[:, None]
    total = np.bincount(sample.track, sample.weight, sample.people)
    std = np.sqrt(mean(noise_m**2) / (spread * total))
    return np.hypot(*velocity.T), np.sqrt(mean((stray**2).sum(axis=1))), std
