"""The camera's height, tilt and roll from the people who walk before it.

Each person's height is the same all along the track, near and far: that fixes the tilt, the roll and
the ratio of every height to the camera's. The population's mean stature fixes the scale. Robust
nonlinear least squares over the rows of the heads, given the feet:

    y_h = (Z y_f - H' cos t) / (Z - H' sin t),   Z = h_c / (y_f cos t + sin t)

H' being how tall a body of the height H seems from there (`optics.silhouette.per_stature`),
with the pose (h_c, t, roll), one height H a person, and the ratio of the mean of the people here to the
population's as unknowns. Where somebody's height is known, or a length of the place, that fixes the
scale more closely than the population does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.optimize import OptimizeResult, least_squares

from pipeline.calibrate.walkers.bordered_solver import ROBUST
from pipeline.calibrate.walkers.joint import joint_errors
from pipeline.calibrate.walkers.known_lengths import (
    NOTHING_KNOWN,
    KnownLengths,
    check_known,
    scale_of,
)
from pipeline.calibrate.walkers.known_people import conditioned
from pipeline.calibrate.walkers.model import (
    MEAN,
    PEOPLE,
    REACH,
    Sample,
    Scale,
    jacobian,
    predict,
    residuals,
)
from pipeline.calibrate.walkers.sample import chosen_tracks, only, sample_of
from pipeline.calibrate.walkers.upright_edges import NO_UPRIGHTS, Uprights, find_uprights
from pipeline.core.arrays import FloatArray
from pipeline.core.config import SizePrior
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import GroundPlane
from pipeline.core.robust import MAD_TO_STD
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import foot_depth_m, height_m, remove_roll
from pipeline.optics.silhouette import per_stature

# Two people give a line of sight each for tilt and height; below four, one who stoops decides.
MIN_PEOPLE = 4
# The result must be this well determined to be of use.
MAX_HEIGHT_ERROR = 0.15  # standard error of the camera's height, relative
MAX_TILT_ERROR_RAD = np.deg2rad(5.0)
# A track this many standard deviations of the population's stature from the median is not one grown
# person: of a hundred people one is lost, of groups and fragments most.
MAX_DEVIATION = 2.6
MAX_REJECTIONS = 4
UPRIGHT_TILT_STD_RAD = np.deg2rad(1.5)  # about the tilt found, upright edges are looked for
REFINEMENTS = 2  # which way people walk is known better with each pose; the second moves it little
TILTS_RAD = np.deg2rad([2.0, 8.0, 15.0, 25.0, 35.0, 50.0])


@dataclass(frozen=True, slots=True)
class WalkersReport:
    """Evidence of the people for a pose."""

    people: int
    observations: int
    residual_px: float  # robust spread of the heads about the fit
    depth_ratio: float  # farthest over nearest depth of an observation
    camera_height_std_m: float
    tilt_std_rad: float
    roll_std_rad: float
    uprights: int = 0  # edges of the place that were taken for vertical
    mean_ratio: float = 1.0  # mean stature of the people here over the population's


@dataclass(frozen=True, slots=True)
class Fitted:
    """A pose fitted to walkers, and the tracks that were used."""

    measured: Measured
    sample: Sample
    scale: Scale
    fit: OptimizeResult
    known: KnownLengths = NOTHING_KNOWN

    def result(self) -> tuple[GroundPlane, WalkersReport]:
        """Return the pose with its covariance, and how well it is determined.

        Raises:
            CalibrationUndetermined: their tracks do not fix the pose.
            UsageError: a person of known height is nowhere seen from head to feet.
        """
        plane = replace(plane_of(self.fit), source="walkers")
        joint = joint_errors(self.fit, self.sample, self.scale, self.measured, plane)
        to_metres = np.diag([plane.camera_height_m, 1.0, 1.0])
        covariance = to_metres @ joint.covariance[:3, :3] @ to_metres
        plane = replace(plane, covariance=covariance, joint=joint)
        for person in self.known.heights:
            if person.track_id not in self.sample.track_id:
                plane = conditioned(plane, self.measured, person)
        check_determined(plane)
        std, edges = np.sqrt(np.diag(plane.covariance)), len(self.scale.uprights)
        return plane, report_of(self.fit, self.sample, self.measured, std, edges)


def calibrate_from_walkers(
    measured: Measured,
    prior: SizePrior,
    known: KnownLengths = NOTHING_KNOWN,
    lines_px: FloatArray | None = None,
) -> tuple[GroundPlane, WalkersReport]:
    """Return the pose of the camera with its covariance, and how well it is determined.

    Args:
        measured: the observations of one camera; its intrinsics must be known.
        prior: stature of the population, mean and spread.
        known: what is known of this scene in metres.
        lines_px: straight edges of the place, x0 y0 x1 y1, (m, 4); those that are upright help.

    Raises:
        CalibrationUndetermined: too few people, or their tracks do not fix the pose.
        UsageError: what is known is of somebody who is not there, or makes no sense.
    """
    return fit_walkers(measured, prior, known, lines_px).result()


def fit_walkers(
    measured: Measured,
    prior: SizePrior,
    known: KnownLengths = NOTHING_KNOWN,
    lines_px: FloatArray | None = None,
) -> Fitted:
    """Return the fit of `calibrate_from_walkers`, however well it is determined."""
    check_known(known, measured)
    measured, people = chosen_tracks(measured, prior, known)
    sample = sample_of(measured, prior, people)
    check_enough(sample)
    sample, best = _fit_alike(sample, prior, known, measured)
    uprights = NO_UPRIGHTS
    for _ in range(REFINEMENTS):
        chosen = set(sample.track_id.tolist())
        again = sample_of(measured, prior, people, plane_of(best))
        sample = only(again, np.array([i in chosen for i in again.track_id.tolist()]))
        uprights = uprights_at(lines_px, measured, best)
        sample, best = _fit_alike(sample, prior, known, measured, best, uprights)
    scale = scale_of(sample, prior, known, measured, uprights, plane_of(best))
    return Fitted(measured, sample, scale, best, known)


def check_enough(sample: Sample) -> None:
    """Refuse too few people."""
    if sample.people < MIN_PEOPLE:
        raise CalibrationUndetermined(
            f"{sample.people} people were followed well enough to find the camera's pose, "
            f"{MIN_PEOPLE} are needed",
            remedy="Give camera_height_m and tilt_deg in a camera file, or a longer recording",
        )


def check_determined(plane: GroundPlane) -> None:
    """Refuse a pose that is too unsure to be of use."""
    std = np.sqrt(np.diag(plane.covariance))
    above_m, tilt = plane.camera_height_m, plane.tilt_rad
    if std[0] > MAX_HEIGHT_ERROR * above_m or std[1] > MAX_TILT_ERROR_RAD or tilt < 0:
        raise CalibrationUndetermined(
            f"the tracks do not determine the camera's pose: height {above_m:.1f} ± {std[0]:.1f} m, "
            f"tilt {np.rad2deg(tilt):.1f} ± {np.rad2deg(std[1]):.1f} degrees",
            remedy="Give camera_height_m and tilt_deg in a camera file, or a longer recording",
        )


def _fit_alike(
    sample: Sample,
    prior: SizePrior,
    known: KnownLengths,
    measured: Measured,
    before: OptimizeResult | None = None,
    uprights: Uprights = NO_UPRIGHTS,
) -> tuple[Sample, OptimizeResult]:
    """Fit, leave out the tracks that the fit shows not to be one adult person, and fit again."""
    plane = plane_of(before) if before is not None else None
    scale = scale_of(sample, prior, known, measured, uprights, plane)
    best = best_fit(sample, scale, before)
    for _ in range(MAX_REJECTIONS):
        # Somebody whose height is known may be as tall as they like.
        alike = are_alike(sample, best, prior) | ~scale.of_population
        if alike.all() or alike.sum() < MIN_PEOPLE:
            break
        sample = only(sample, alike)
        scale = scale_of(sample, prior, known, measured, uprights, plane_of(best))
        best = best_fit(sample, scale, best)
    return sample, best


def uprights_at(lines_px: FloatArray | None, measured: Measured, fit: OptimizeResult) -> Uprights:
    """Return the edges of the place that are upright, looked for about the tilt that was found."""
    if lines_px is None or measured.intrinsics is None or not len(lines_px):
        return NO_UPRIGHTS
    return find_uprights(lines_px, measured.intrinsics, float(fit.x[1]), UPRIGHT_TILT_STD_RAD)


def plane_of(fit: OptimizeResult) -> GroundPlane:
    """Return the pose of a fit."""
    return GroundPlane(float(np.exp(fit.x[0])), float(fit.x[1]), float(fit.x[2]))


def best_fit(sample: Sample, scale: Scale, before: OptimizeResult | None = None) -> OptimizeResult:
    """Return the fit from where one was before, or the better from the two most promising tilts."""
    if before is not None and (before.x[1] > 0 or scale.pose is not None):
        return _fit(sample, scale, float(before.x[1]))
    if scale.pose is not None:
        return _fit(sample, scale, float(scale.pose.pose[1]))
    starts = sorted(TILTS_RAD, key=lambda tilt: _start_cost(sample, scale, tilt))
    fits = [_fit(sample, scale, tilt) for tilt in starts[:2]]
    return min(fits, key=lambda fit: float(fit.cost))


def are_alike(sample: Sample, fit: OptimizeResult, prior: SizePrior) -> npt.NDArray[np.bool_]:
    """Return which tracks, (p,), may be of grown people, one a box: as tall as the others.

    Two people in one box are twice as tall, a bag or half a person half as tall; what a pose gives is
    compared with the median of all, so that the scale need not be right yet.
    """
    pose = fit.x.copy()
    y_f = remove_roll(sample.foot, pose[2])[:, 1]
    y_h = remove_roll(sample.head, pose[2])[:, 1]
    z_m = foot_depth_m(np.exp(pose[0]), pose[1], y_f)
    tall_m = height_m(z_m, y_f, y_h, pose[1])
    tall_m = tall_m / per_stature(y_h, pose[1], sample.reach + pose[REACH])
    typical_m = pd.Series(tall_m).groupby(sample.track).median().to_numpy()
    relative = typical_m / np.nanmedian(typical_m) - 1
    return np.abs(relative) < MAX_DEVIATION * prior.std_m / prior.mean_m


def _start(sample: Sample, scale: Scale, tilt: float) -> FloatArray:
    """Return unknowns to start from at a tilt: everybody is as tall as is expected of them."""
    above_m = _height_for(sample, scale, tilt)
    return np.concatenate(
        [[np.log(above_m), tilt, scale.uprights.roll_rad, *np.zeros(PEOPLE - 3)], scale.mean_m]
    )


def _start_cost(sample: Sample, scale: Scale, tilt: float) -> float:
    """Return how badly a start fits, each residual counting no more than a bad one."""
    off = residuals(_start(sample, scale, tilt), sample, scale)
    return float(np.minimum(np.abs(off), 5.0).sum())


def limits(scale: Scale) -> tuple[FloatArray, FloatArray]:
    """Return the bounds of the unknowns: what can be."""
    low = [np.log(0.3), np.deg2rad(-10), -0.35, -1.0, -0.3, -1.0, -0.1, *(0.4 * scale.mean_m)]
    high = [np.log(200.0), np.deg2rad(89), 0.35, 1.0, 0.3, 1.0, 0.1, *(1.6 * scale.mean_m)]
    return np.array(low), np.array(high)


def _fit(sample: Sample, scale: Scale, tilt: float) -> OptimizeResult:
    start = _start(sample, scale, tilt)
    return least_squares(
        residuals,
        start,
        jac=jacobian,
        args=(sample, scale),
        loss="soft_l1",
        f_scale=ROBUST,
        bounds=limits(scale),
        x_scale="jac",
        max_nfev=200,
    )


def _height_for(sample: Sample, scale: Scale, tilt: float) -> float:
    """Return the camera height that gives people their expected stature at a tilt, in the median."""
    y_f, y_h = sample.foot[:, 1], sample.head[:, 1]
    unit_m = height_m(foot_depth_m(1.0, tilt, y_f), y_f, y_h, tilt)
    unit_m = unit_m / per_stature(y_h, tilt, sample.reach)
    typical = np.nanmedian(unit_m) if np.isfinite(unit_m).any() else np.nan
    return float(np.clip(np.median(scale.mean_m) / typical, 0.5, 100.0)) if typical > 0 else 5.0


def report_of(
    fit: OptimizeResult, sample: Sample, measured: Measured, std: FloatArray, uprights: int
) -> WalkersReport:
    """Return how well a fit is determined; `std` is of camera height, tilt and roll."""
    error = remove_roll(sample.head, fit.x[2])[:, 1] - predict(fit.x, sample)
    focal_px = measured.intrinsics.fy_px if measured.intrinsics else np.nan
    y_f = remove_roll(sample.foot, fit.x[2])[:, 1]
    depth_m = foot_depth_m(np.exp(fit.x[0]), fit.x[1], y_f)
    return WalkersReport(
        people=sample.people,
        observations=len(sample.track),
        residual_px=float(MAD_TO_STD * np.nanmedian(np.abs(error)) * focal_px),
        depth_ratio=float(np.nanmax(depth_m) / np.nanmin(depth_m)),
        camera_height_std_m=float(std[0]),
        tilt_std_rad=float(std[1]),
        roll_std_rad=float(std[2]),
        uprights=uprights,
        mean_ratio=float(np.exp(fit.x[MEAN])),
    )
