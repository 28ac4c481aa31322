"""Covariance of a fit to walkers.

Boxes of one track err together: where somebody stands before a dark wall they are all too short, and how
long that lasts differs by camera and detector. So the errors are not taken as stated. The fit is asked
how it changes without one track after another (the cluster jackknife CR3: Bell and McCaffrey 2002, Survey
Methodology 28), and what the tracks disagree by is the variance. A dozen tracks tell a variance to a
third; it is drawn to the one that follows from the deviations of the boxes, which counts as a few
tracks more.

What all tracks have in common shows in no disagreement. It is considered (consider analysis, as in
Tapley, Schutz and Born, Statistical Orbit Determination, section 6.5): boxes that are too tall by a
share, by one that changes with size, and by one that changes from side to side; and a lens that bends
what is seen more or less than is known of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import OptimizeResult

from pipeline.calibrate.walkers.bordered_solver import Bordered, by_person, inverse_of, robust_pull
from pipeline.calibrate.walkers.model import ABOVE, PEOPLE, ROLL, TILT, Sample, Scale, residuals
from pipeline.core.arrays import FloatArray
from pipeline.core.robust import MAD_TO_STD
from pipeline.estimate.boxes.error_correlation import BOX_COMMON_STD

# Residuals do not show what a track's boxes have in common, so for the variance that follows from the
# stated deviations they may not say less than half of it.
MIN_VARIANCE_RATIO = 0.5
STATED_TRACKS = 5.0  # as so many the stated deviations count
# What boxes have in common is the more the worse they are: in units of how much more the heads scatter
# about the fit than gaits let those of true boxes. By one factor on all, by one between small and large
# (by a factor of e), and by one from side to side (by a standard deviation of the columns). Chosen on 24
# rendered cameras so that scale, tilt and roll hold; the motion detector's boxes scatter by 2.0 % of the
# stature there, and their sizes differ by 1.2 %, 1.6 % and 0.4 %, not independently of where people walk.
GAIT_SCATTER = 0.013
ALL_PER_EXCESS, NEAR_PER_EXCESS, SIDE_PER_EXCESS = 1.8, 2.0, 0.3
LEAST_EXCESS = 0.003  # boxes that seem perfect may still be made by a rule of somebody's


def covariance_of(
    fit: OptimizeResult,
    sample: Sample,
    scale: Scale,
    wanted: Sequence[int] = (ABOVE, TILT, ROLL),
) -> FloatArray:
    """Return the covariance of (camera height, tilt, roll), or of the unknowns `wanted`.

    Height, in metres for its logarithm, must be the first.
    """
    slopes = Bordered.of(fit.jac, sample)
    inverse = inverse_of(slopes.shared.T @ slopes.shared)
    moved = inverse @ (slopes.shared.T @ _common(fit, sample, scale))
    covariance = fitted_covariance(fit, sample, scale) + moved @ moved.T
    shared = [unknown if unknown < PEOPLE else unknown - sample.people for unknown in wanted]
    to_metres = np.diag([float(np.exp(fit.x[ABOVE])), *np.ones(len(wanted) - 1)])
    return np.asarray(to_metres @ covariance[np.ix_(shared, shared)] @ to_metres)


def fitted_covariance(fit: OptimizeResult, sample: Sample, scale: Scale) -> FloatArray:
    """Return the covariance of all shared unknowns, (k, k), but for what boxes have in common."""
    slopes = Bordered.of(fit.jac, sample)
    inverse = inverse_of(slopes.shared.T @ slopes.shared)
    excess = _excess(fit, sample)
    share = sample.people / (sample.people + STATED_TRACKS)
    by_tracks = _by_tracks(slopes, inverse, fit, sample, scale, excess)
    return np.asarray(share * by_tracks + (1 - share) * _as_stated(fit, excess, sample))


def _excess(fit: OptimizeResult, sample: Sample) -> float:
    """Return the variance of the heads about the fit over the stated one, or what counts for it."""
    rows = len(sample.track)
    freedom = max(sample.weight.sum() - PEOPLE - sample.people, 1.0)
    excess = float((np.minimum(np.abs(fit.fun[:rows]), 3) ** 2).sum() / freedom)
    return max(excess, MIN_VARIANCE_RATIO)


def _as_stated(fit: OptimizeResult, excess: float, sample: Sample) -> FloatArray:
    """Return the covariance by the stated deviations, those of the heads as they are found to be."""
    per_row = np.ones(len(fit.fun))
    per_row[: len(sample.track)] /= np.sqrt(excess)
    shared = Bordered.of(fit.jac, sample, per_row).shared
    return inverse_of(shared.T @ shared)


def _by_tracks(
    slopes: Bordered,
    inverse: FloatArray,
    fit: OptimizeResult,
    sample: Sample,
    scale: Scale,
    excess: float,
) -> FloatArray:
    """Return the covariance by how much the fit changes when one track after another is left out.

    What is known beside the tracks varies as it is said to; and so does who is of known height, as
    without them the scale would be another.
    """
    rows, people = len(sample.track), sample.people
    shared, known = slopes.shared, ~scale.of_population
    of_known = np.sqrt(excess) * shared[:rows][known[sample.track]]
    beside = np.vstack([of_known, shared[rows : rows + people][known], shared[rows + people :]])
    varied = inverse @ beside.T
    pull = robust_pull(fit.fun)[: rows + people]
    # Of each track: the heads, and the stature beside what is expected of it.
    theirs = shared[: rows + people]
    squares = by_person(theirs[:, :, None] * theirs[:, None, :], slopes.person, people)
    pulls = by_person(theirs * pull[:, None], slopes.person, people)
    without = (shared.T @ shared - squares)[~known]
    change = (inverse_of(without) @ pulls[~known][:, :, None])[:, :, 0]
    return np.asarray(varied @ varied.T + (people - 1) / people * change.T @ change)


def _common(fit: OptimizeResult, sample: Sample, scale: Scale) -> FloatArray:
    """Return what all tracks may have in common, as residuals, a column each."""
    tall = sample.foot[:, 1] - sample.head[:, 1]
    per_share = tall / sample.sigma * np.sqrt(sample.weight)
    excess = box_excess(fit, sample)
    shares = [
        np.full(len(tall), np.hypot(BOX_COMMON_STD, ALL_PER_EXCESS * excess)),
        NEAR_PER_EXCESS * excess * sample.trends[:, 1],
    ]
    if not len(scale.uprights):
        shares.append(SIDE_PER_EXCESS * excess * sample.trends[:, 0])
    common = np.zeros((len(fit.fun), len(shares) + 1))
    common[: len(tall), :-1] = np.stack(shares, axis=1) * per_share[:, None]
    if len(fit.x) == PEOPLE + sample.people:  # with the focal length unknown, it is of that error
        common[:, -1] = bent_residuals(fit.x, sample, scale) * scale.bend_std
    return common


def box_excess(fit: OptimizeResult, sample: Sample) -> float:
    """Return by how much more heads scatter about the fit than gaits let them, as a share of statures."""
    tall = sample.foot[:, 1] - sample.head[:, 1]
    per_share = tall / sample.sigma * np.sqrt(sample.weight)
    scatter = MAD_TO_STD * float(np.nanmedian(np.abs(fit.fun[: len(tall)] / per_share)))
    return float(np.sqrt(max(scatter**2 - GAIT_SCATTER**2, LEAST_EXCESS**2)))


def bent_residuals(x: FloatArray, sample: Sample, scale: Scale) -> FloatArray:
    """Return what a unit of bend, k of x (1 + k r^2), changes in the residuals.

    Upright edges have an unknown of their own for it.
    """
    step = 1e-4

    def bend(points: FloatArray) -> FloatArray:
        return np.asarray(points * (1.0 + step * (points**2).sum(axis=-1, keepdims=True)))

    bent = replace(sample, foot=bend(sample.foot), head=bend(sample.head))
    segments = replace(scale.segments, points=bend(scale.segments.points))
    other = residuals(x, bent, replace(scale, segments=segments))
    return np.asarray((other - residuals(x, sample, scale)) / step)
