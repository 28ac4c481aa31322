"""The focal length in pixels beside the pose, from people who walk, of a camera without lens data.

Assumed: square pixels, the principal point in the middle of the picture, no distortion. Without
distortion another focal length only scales all normalised points, so the fit of `calibrate.walkers`
has one unknown more, the logarithm q of the focal length over the one at which points were normalised:
points and their deviations are multiplied by exp(-q). What tells it: how people shorten below a camera
that looks down (the vertical vanishing point), the horizon from their sizes near and far, and upright
edges: the product of the distances of the two from the middle is the focal length squared. And `pace`:
that people walk as fast away from the camera as across the picture.

The fit has several minima, so it is started from several fields of view.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import OptimizeResult, least_squares
from scipy.sparse import csr_matrix, hstack, vstack

from pipeline.calibrate.walkers.bordered_solver import ROBUST, settle
from pipeline.calibrate.walkers.covariance import covariance_of
from pipeline.calibrate.walkers.known_lengths import (
    NOTHING_KNOWN,
    KnownLengths,
    check_known,
    scale_of,
)
from pipeline.calibrate.walkers.model import (
    ABOVE,
    MEAN,
    PEOPLE,
    REACH,
    ROLL,
    TILT,
    Sample,
    Scale,
    head_slopes,
    jacobian,
    residuals,
)
from pipeline.calibrate.walkers.pace import Pace, pace_of
from pipeline.calibrate.walkers.pose import (
    MAX_REJECTIONS,
    MIN_PEOPLE,
    REFINEMENTS,
    WalkersReport,
    are_alike,
    best_fit,
    check_determined,
    check_enough,
    limits,
    plane_of,
    report_of,
    uprights_at,
)
from pipeline.calibrate.walkers.sample import chosen_tracks, only, sample_of
from pipeline.calibrate.walkers.upright_edges import NO_UPRIGHTS, Uprights
from pipeline.core.arrays import FloatArray
from pipeline.core.config import SizePrior
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import FoundLens, GroundPlane, Intrinsics
from pipeline.estimate.types import Measured

# Fixed cameras are sold with lenses of 2.1 to 12 mm before sensors 4.8 to 5.6 mm wide (1/3" to 1/2.7"):
# fields of view of 25 to 105 degrees across. A normal deviate of the logarithm of the focal length about
# that of 65 degrees, with this deviation, has nine tenths between 35 and 110 and 95 % between 27 and 119.
USUAL_VIEW_RAD = np.deg2rad(65.0)
LOG_FOCAL_STD = 0.5
VIEWS_RAD = np.deg2rad([25.0, 40.0, 65.0, 95.0])  # to start from
# Beyond this it is of little use, and leans on what is usual: (0.2 / 0.5)^2 is a sixth of the word.
MAX_FOCAL_ERROR = 0.2
# What is assumed is not exact: a principal point 3 % of the width off the middle, 2 % of distortion, and
# a place where people walk a few per cent faster one way than the other.
MODEL_STD = 0.05  # relative
# And the fit seems surer than it is, as it bends where it is taken for straight: of 25 cameras of
# `bench.walkers` the errors of the 6 that were found were half as large again as stated without this. It
# does not decide which are of use.
BENT_STD = 0.1
LOW, HIGH = -1.6, 1.9  # q about the usual view: 145 to 11 degrees
STEP = 1e-5  # of q, for its derivative


def calibrate_lens_from_walkers(
    measured: Measured,
    size_px: tuple[int, int],
    prior: SizePrior,
    known: KnownLengths = NOTHING_KNOWN,
    lines_px: FloatArray | None = None,
) -> tuple[FoundLens, GroundPlane, WalkersReport]:
    """Return lens and pose of a camera without lens data; the pose has a `focal_covariance`.

    Args:
        measured: the observations of one camera; its intrinsics are not looked at.
        size_px: width and height of its pictures.
        prior: stature of the population, mean and spread.
        known: what is known of this scene in metres.
        lines_px: straight edges of the place, x0 y0 x1 y1, (m, 4); those that are upright help.

    Raises:
        CalibrationUndetermined: too few people, or they do not fix the focal length or the pose.
        UsageError: what is known is of somebody who is not there, or makes no sense.
    """
    check_known(known, measured)
    usual_px = focal_px(USUAL_VIEW_RAD, size_px[0])
    measured = replace(measured, intrinsics=_square(size_px, usual_px))
    measured, people = chosen_tracks(measured, prior, known)
    sample = sample_of(measured, prior, people)
    check_enough(sample)
    sample, best = _fit_alike(sample, prior, known, measured, NO_UPRIGHTS, _starts())
    uprights = NO_UPRIGHTS
    for _ in range(REFINEMENTS):
        at_px = focal_px(USUAL_VIEW_RAD, size_px[0]) * float(np.exp(best.x[-1]))
        measured = replace(measured, intrinsics=_square(size_px, at_px))
        pose = _of_pose(best)
        chosen = set(sample.track_id.tolist())
        again = sample_of(measured, prior, people, plane_of(pose))
        sample = only(again, np.array([i in chosen for i in again.track_id.tolist()]))
        uprights = uprights_at(lines_px, measured, pose)
        # The points are normalised by the focal length that was found: q starts at nought anew.
        start = float(best.x[-1])
        sample, best = _fit_alike(
            sample, prior, known, measured, uprights, [0.0], start, _at_zero(pose)
        )
        best.x[-1] += start
    scale = scale_of(sample, prior, known, measured, uprights, plane_of(_of_pose(best)))
    return _result(best, sample, scale, measured, size_px)


def focal_px(view_rad: float, width_px: int) -> float:
    """Return the focal length of a field of view across the picture."""
    return float(width_px / 2 / np.tan(view_rad / 2))


def _square(size_px: tuple[int, int], focal: float) -> Intrinsics:
    width_px, height_px = size_px
    return Intrinsics(width_px, height_px, focal, focal, (width_px - 1) / 2, (height_px - 1) / 2)


def _starts() -> list[float]:
    return [float(np.log(focal_px(v, 1) / focal_px(USUAL_VIEW_RAD, 1))) for v in VIEWS_RAD]


def _of_pose(fit: OptimizeResult) -> OptimizeResult:
    """Return a fit without the focal length."""
    return OptimizeResult(fit | {"x": fit.x[:-1]})


def _at_zero(pose: OptimizeResult) -> OptimizeResult:
    """Return the fit of a pose at the focal length by which points are normalised."""
    return OptimizeResult(x=np.append(pose.x, 0.0))


def scaled(sample: Sample, scale: Scale, q: float) -> tuple[Sample, Scale]:
    """Return what a focal length exp(q) times as long would have made of both."""
    by = float(np.exp(-q))
    edges = replace(scale.uprights, middle=scale.uprights.middle * by)
    segments = replace(scale.segments, points=scale.segments.points * by)
    return (
        replace(sample, foot=sample.foot * by, head=sample.head * by, sigma=sample.sigma * by),
        replace(scale, segments=segments, uprights=edges),
    )


def _residuals(x: FloatArray, sample: Sample, scale: Scale, pace: Pace, usual: float) -> FloatArray:
    seen, known = scaled(sample, scale, x[-1])
    return np.concatenate([residuals(x[:-1], seen, known), _own(x, seen, known, pace, usual)])


def _own(x: FloatArray, sample: Sample, scale: Scale, pace: Pace, usual: float) -> FloatArray:
    """Return the residuals that the fit of a pose alone does not have."""
    prior = (x[-1] + usual) / LOG_FOCAL_STD
    return np.append(pace.off(x, sample), [prior, _as_residual(freedom(x, sample, scale))])


def freedom(x: FloatArray, sample: Sample, scale: Scale) -> float:
    """Return half the logarithm of how sharply all statures are seen: of the determinant of their part.

    Statures are many and unknown, so the likelihood of a pose is that of the boxes whatever they are:
    the best statures' times the square root of that determinant's inverse (Laplace). With a known lens
    it hardly changes over the poses that fit; but a camera just above the heads sees every centimetre
    of stature large, so that without this a short lens low down would make everybody alike.
    """
    typical = x[:-1].copy()
    typical[PEOPLE:] = scale.mean_m * np.exp(x[MEAN])
    by_log = head_slopes(typical, sample)[:, -1] * typical[PEOPLE:][sample.track]
    relative = scale.std_m / scale.mean_m
    sharp = np.bincount(sample.track, by_log**2, sample.people) + relative**-2
    return float(0.5 * np.log(sharp * relative**2).sum())


def _as_residual(cost: float) -> float:
    """Return the residual that costs so much by soft_l1; a constant keeps it above nought."""
    return ROBUST * float(np.sqrt((1 + (cost + ROBUST**2) / ROBUST**2) ** 2 - 1))


def _jacobian(x: FloatArray, sample: Sample, scale: Scale, pace: Pace, usual: float) -> csr_matrix:
    """Return the derivatives of `_residuals`: those of the fit of a pose, and differences."""
    seen, known = scaled(sample, scale, x[-1])
    of_fit = jacobian(x[:-1], seen, known)
    last = len(x) - 1
    step = STEP * np.eye(len(x))
    own = partial(_own, sample=seen, scale=known, pace=pace, usual=usual)
    below = np.zeros((len(pace) + 2, last))
    for unknown in (ABOVE, TILT, ROLL):
        below[:, unknown] = (own(x + step[unknown]) - own(x - step[unknown])) / (2 * STEP)
    for unknown in (MEAN, REACH):  # which no speed depends on
        ends = [_as_residual(freedom(x + by * step[unknown], seen, known)) for by in (1, -1)]
        below[-1, unknown] = (ends[0] - ends[1]) / (2 * STEP)
    off = partial(_residuals, sample=sample, scale=scale, pace=pace, usual=usual)
    by_focal = (off(x + step[last]) - off(x - step[last])) / (2 * STEP)
    of_pose = vstack([of_fit, csr_matrix(below)])
    return csr_matrix(hstack([of_pose, csr_matrix(by_focal[:, None])]))


def fit_focal(
    sample: Sample, scale: Scale, pace: Pace, q: float, usual: float = 0.0
) -> OptimizeResult:
    """Return the fit of pose and focal length from a q to start from.

    `usual` is the logarithm of the focal length at q = 0 over the usual one, or any that is expected.
    """
    posed = best_fit(*scaled(sample, scale, q))
    low, high = limits(scale)
    given = partial(_residuals, usual=usual), partial(_jacobian, usual=usual)
    return least_squares(
        given[0],
        np.append(posed.x, q),
        jac=given[1],
        args=(sample, scale, pace),
        loss="soft_l1",
        f_scale=ROBUST,
        bounds=([*low, LOW - usual], [*high, HIGH - usual]),
        x_scale="jac",
        max_nfev=200,
    )


def free_focal(fit: OptimizeResult, sample: Sample, scale: Scale, pace: Pace) -> OptimizeResult:
    """Return the fit of pose and focal length from that of a pose, by the same residuals.

    One start that is near: Levenberg and Marquardt's steps with statures eliminated take a tenth of
    the evaluations of `least_squares`, whose inner solver sees a hundred unknowns.
    """
    low, high = (
        np.append(bounds, end) for bounds, end in zip(limits(scale), (LOW, HIGH), strict=True)
    )
    given = sample, scale, pace, 0.0
    return settle(
        lambda x: _residuals(x, *given),
        lambda x: _jacobian(x, *given),
        np.append(fit.x, 0.0),
        (low, high),
        sample,
    )


def _fit_alike(
    sample: Sample,
    prior: SizePrior,
    known: KnownLengths,
    measured: Measured,
    uprights: Uprights,
    starts: list[float],
    usual: float = 0.0,
    before: OptimizeResult | None = None,
) -> tuple[Sample, OptimizeResult]:
    """Fit, leave out the tracks that the fit shows not to be one adult person, and fit again."""
    for turn in range(MAX_REJECTIONS + 1):
        plane = plane_of(_of_pose(before)) if before is not None else None
        scale = scale_of(sample, prior, known, measured, uprights, plane)
        pace = pace_of(sample, before)
        fits = [fit_focal(sample, scale, pace, q, usual) for q in starts]
        best = min(fits, key=lambda fit: float(fit.cost))
        seen, _ = scaled(sample, scale, best.x[-1])
        alike = are_alike(seen, _of_pose(best), prior) | ~scale.of_population
        if turn == MAX_REJECTIONS or alike.all() or alike.sum() < MIN_PEOPLE:
            break
        sample, starts, before = only(sample, alike), [float(best.x[-1])], best
    return sample, best


def _result(
    best: OptimizeResult,
    sample: Sample,
    scale: Scale,
    measured: Measured,
    size_px: tuple[int, int],
) -> tuple[FoundLens, GroundPlane, WalkersReport]:
    found_px = focal_px(USUAL_VIEW_RAD, size_px[0]) * float(np.exp(best.x[-1]))
    wanted = (ABOVE, TILT, ROLL, len(best.x) - 1)
    covariance = covariance_of(best, sample, scale, wanted)
    covariance[3, 3] += MODEL_STD**2
    relative = float(np.sqrt(covariance[3, 3]))
    if not relative < MAX_FOCAL_ERROR:
        raise CalibrationUndetermined(
            f"the tracks do not determine the focal length: {found_px:.0f} px ± {100 * relative:.0f} %, "
            f"at most {100 * MAX_FOCAL_ERROR:.0f} % is of use",
            remedy="Give fx_px, or focal_length_mm and pixel_pitch_x_um, in a camera file",
        )
    covariance[3, 3] += BENT_STD**2
    relative = float(np.sqrt(covariance[3, 3]))
    plane = replace(
        plane_of(best),
        covariance=covariance[:3, :3],
        source="walkers",
        focal_covariance=covariance[3],
    )
    check_determined(plane)
    intrinsics = _square(size_px, found_px)
    sample = scaled_to(sample, measured, found_px)
    std = np.sqrt(np.diag(plane.covariance))
    at_found = replace(measured, intrinsics=intrinsics)
    report = report_of(_of_pose(best), sample, at_found, std, len(scale.uprights))
    return FoundLens(intrinsics, found_px * relative), plane, report


def scaled_to(sample: Sample, measured: Measured, found_px: float) -> Sample:
    """Return the sample as the focal length that was found makes it."""
    by = measured.intrinsics.fx_px / found_px if measured.intrinsics else 1.0
    return replace(sample, foot=sample.foot * by, head=sample.head * by, sigma=sample.sigma * by)
