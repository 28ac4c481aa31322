"""The tilt of a camera whose pose too few people fix: as much as they say of it.

With a tilt t, the box of each person gives how tall they are in heights of the camera,

    log U = log H - log h_c + noise,

by `optics.ground_plane`, and that must be the same near and far along a track, and from person to person
but for the spread of statures. How badly it is not is a likelihood of t. Neither the scale nor the
camera's height is asked for, so that two people do; their tilt is of use to depths from sizes, where the
cosine of it counts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.calibrate.walkers.covariance import NEAR_PER_EXCESS
from pipeline.calibrate.walkers.known_lengths import GAIT_STD, NOTHING_KNOWN
from pipeline.calibrate.walkers.model import ROLL_STD_RAD, Sample
from pipeline.calibrate.walkers.sample import chosen_tracks, sample_of
from pipeline.core.arrays import FloatArray
from pipeline.core.config import SizePrior
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import foot_depth_m, height_m, remove_roll
from pipeline.optics.silhouette import per_stature

# What looks down more steeply sees heads and shoulders; before, tilts to half of it are alike
# (`methods.size.UNKNOWN_TILT_RAD`), and steeper ones the less likely the steeper.
TILTS_RAD = np.deg2rad(np.linspace(0.0, 60.0, 241))
BEFORE = np.clip(2.0 - TILTS_RAD / np.deg2rad(30.0), 1e-3, 1.0)
# A tilt that is hardly better known than without people (8.7 degrees, of a uniform one) is of no use.
MAX_STD_RAD = np.deg2rad(8.0)
# Two people in one box are twice as tall; nobody is so far from the others that it would decide.
MOST_APART = 3.0  # deviations
# Boxes that grow too tall by a share for each factor of e that they are nearer look like a tilt: as
# `walkers.covariance` considers it, for boxes whose heads scatter as gaits and a pixel let them.
STEP_RAD = 1e-4  # of roll, for differences
NEAR_STD = NEAR_PER_EXCESS * 0.01


@dataclass(frozen=True, slots=True)
class Tilt:
    """A tilt, and its standard deviation."""

    tilt_rad: float
    std_rad: float


def tilt_of_people(measured: Measured, prior: SizePrior) -> Tilt | None:
    """Return the mean and deviation of the tilt given the people, and `BEFORE`.

    Args:
        measured: the observations of one camera; its intrinsics must be known.
        prior: stature of the population; only its spread counts.

    Returns:
        None where nobody was followed well enough, or they say too little.
    """
    measured, people = chosen_tracks(measured, prior, NOTHING_KNOWN)
    sample = sample_of(measured, prior, people)
    if not len(sample.track):
        return None
    white = _whitening(sample, prior.std_m / prior.mean_m)
    by_size = NEAR_STD * white(np.log(sample.foot[:, 1] - sample.head[:, 1]))
    cost = np.array([_cost_at(sample, t, white, by_size) for t in TILTS_RAD])
    if not np.isfinite(cost).any():
        return None
    freedom = max(sample.weight.sum() - 2.0, 1.0)
    cost /= max(float(cost.min()) / freedom, 1.0)  # scatter beyond what is stated (Birge 1932)
    weight = BEFORE * np.exp(-0.5 * (cost - cost.min()))
    weight /= weight.sum()
    mean = float(weight @ TILTS_RAD)
    step = TILTS_RAD[1] - TILTS_RAD[0]
    std = float(np.sqrt(weight @ (TILTS_RAD - mean) ** 2 + step**2 / 12))
    return Tilt(mean, std) if std < MAX_STD_RAD else None


def _log_tall(sample: Sample, tilt: float, roll: float = 0.0) -> FloatArray:
    """Return the log of how tall each box is, in heights of the camera, (n,); NaN above the horizon."""
    y_f, y_h = (remove_roll(ends, roll)[:, 1] for ends in (sample.foot, sample.head))
    tall = height_m(foot_depth_m(1.0, tilt, y_f), y_f, y_h, tilt)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.log(tall / per_stature(y_h, tilt, sample.reach)))


def _cost_at(
    sample: Sample, tilt: float, white: Callable[[FloatArray], FloatArray], by_size: FloatArray
) -> float:
    """Return the sum of squares that a tilt leaves, roll and a bias with size having taken their parts.

    Both are unknown, about nought: with U the columns of a deviation of each, the covariance of what
    is off is 1 + U U' (the sum of squares by Woodbury's identity).
    """
    level = _log_tall(sample, tilt)
    by_roll = (_log_tall(sample, tilt, STEP_RAD) - level) * ROLL_STD_RAD / STEP_RAD
    off, columns = white(level), np.column_stack([by_size, white(by_roll)])
    far = np.abs(off) > MOST_APART
    far[: len(level)] = False  # within a track noise is noise
    off[far], columns[far] = MOST_APART, 0.0
    if not (np.isfinite(off).all() and np.isfinite(columns).all()):
        return np.inf
    along = columns.T @ off
    taken = along @ np.linalg.solve(np.eye(2) + columns.T @ columns, along)
    _, spread = np.linalg.slogdet(np.eye(2) + columns.T @ columns)
    return float(off @ off - taken + spread)


def _whitening(sample: Sample, spread: float) -> Callable[[FloatArray], FloatArray]:
    """Return what takes rows, (n,), to their differences within tracks and between, in deviations."""
    share = np.hypot(sample.sigma / (sample.foot[:, 1] - sample.head[:, 1]), GAIT_STD)
    precision = sample.weight / share**2
    total = np.bincount(sample.track, precision, sample.people)
    of_people = 1.0 / (spread**2 + 1.0 / total)

    def white(values: FloatArray) -> FloatArray:
        mean = np.bincount(sample.track, precision * values, sample.people) / total
        within = (values - mean[sample.track]) * np.sqrt(precision)
        apart = (mean - np.median(mean)) * np.sqrt(of_people)
        return np.concatenate([within, apart])

    return white
