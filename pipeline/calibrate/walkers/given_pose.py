"""A pose that a camera file gives with a deviation, narrowed by the people who walk before the camera.

Statures say where the ground is, too. A tilt that is known to a degree leaves distances at 20 m by a
camera at 2 m unsure by a third; people who must be as tall near as far know it better.

One fit of both finds the place. There the people alone have the pose x_p, of the covariance C_p with all
that their boxes have in common (`walkers.joint`); the given pose x_0, of P_0, is an observation of it:

    x = x_p + C_p (C_p + P_0)^-1 (x_0 - x_p)

and C_p is narrowed by it (conditioning of a normal distribution). So it is never less sure than either.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import OptimizeResult

from pipeline.calibrate.walkers.bordered_solver import Bordered, inverse_of, robust_pull
from pipeline.calibrate.walkers.joint import joint_errors
from pipeline.calibrate.walkers.known_lengths import KnownLengths
from pipeline.calibrate.walkers.known_people import narrowed
from pipeline.calibrate.walkers.model import POSE
from pipeline.calibrate.walkers.pose import Fitted, fit_walkers, plane_of
from pipeline.calibrate.walkers.pose_prior import ROWS, log_covariance, log_pose
from pipeline.calibrate.walkers.walker_veto import check_walkers
from pipeline.core.arrays import FloatArray
from pipeline.core.config import CameraConfig, SizePrior
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import Diagnostic, Error, GroundPlane, JointErrors, Severity
from pipeline.estimate.types import Measured

# Of chi-squared of three degrees of freedom: chance takes people so far from a right pose once in a
# thousand cameras.
CONTRADICTED = 16.27


def narrowed_by_people(
    plane: GroundPlane, measured: Measured, entry: CameraConfig, prior: SizePrior
) -> tuple[GroundPlane, Diagnostic | None]:
    """Return a given pose as the people leave it, and what is told of that.

    It stays as it is where it is exact, where people found it (their statures count once; it has
    correlations or a focal length of its own), where too few people walk, and where they contradict it.

    Args:
        plane: the given pose.
        measured: people of its camera.
        entry: the camera's entry in the camera file.
        prior: of their stature.
    """
    found_before = bool(entry.pose_correlation) or plane.focal_covariance is not None
    if found_before or not plane.covariance.any() or measured.intrinsics is None:
        return plane, None
    known = KnownLengths(pose=plane)  # its lengths check the pose, `run.scale_notes`
    try:
        check_walkers(measured, prior.object_class)
        fitted = fit_walkers(measured, prior, known)
    except CalibrationUndetermined:
        return plane, None
    by_people, joint = _people_alone(fitted)
    both = joint.covariance[:3, :3] + log_covariance(plane)
    apart = log_pose(plane) - by_people
    people = f"{fitted.sample.people} people"
    if float(apart @ np.linalg.solve(both, apart)) > CONTRADICTED:
        alone = _posed(by_people, joint, plane.source)
        return plane, Diagnostic(
            Severity.WARNING,
            "given_pose_contradicted",
            f"the given pose ({_text(plane)}) and that by {people} ({_text(alone)}) are farther apart "
            "than their deviations let them be. The given one is used: check it, its deviations and "
            "the lens; leave it out of the camera file to use that by the people",
            camera=entry.name,
        )
    found = _posed(
        by_people + joint.covariance[:3, :3] @ np.linalg.solve(both, apart),
        _given(joint, log_covariance(plane)),
        plane.source,
    )
    note = Diagnostic(
        Severity.INFO,
        "given_pose_narrowed",
        f"the given pose ({_text(plane)}) is narrowed by {people} to {_text(found)} (one standard error)",
        camera=entry.name,
    )
    return found, note


def _people_alone(fitted: Fitted) -> tuple[FloatArray, JointErrors]:
    """Return the log pose, (3,), that the people have without the given one, to first order, and errors.

    At the optimum of both the pulls of people and of the given pose cancel: without it, the people go
    where theirs takes them.
    """
    fit, scale = fitted.fit, replace(fitted.scale, pose=None)
    alone = OptimizeResult(x=fit.x, fun=fit.fun[:-ROWS], jac=fit.jac[:-ROWS], cost=fit.cost)
    bordered = Bordered.of(alone.jac, fitted.sample)
    step = inverse_of(bordered.shared.T @ bordered.shared) @ (
        bordered.shared.T @ robust_pull(alone.fun)
    )
    joint = joint_errors(alone, fitted.sample, scale, fitted.measured, plane_of(fit))
    return np.asarray((fit.x[: len(step)] - step)[POSE]), joint


def _given(joint: JointErrors, covariance: FloatArray) -> JointErrors:
    """Return errors after the observation of the pose with a covariance, (3, 3).

    Along its principal axes its errors are independent, so they come one after another.
    """
    variances, axes = np.linalg.eigh(covariance)
    for variance, axis in zip(variances, axes.T, strict=True):
        slope = np.zeros(len(Error))
        slope[:3] = axis
        joint = narrowed(joint, slope, float(variance + slope @ joint.covariance @ slope))
    return joint


def _posed(pose: FloatArray, joint: JointErrors, source: str) -> GroundPlane:
    height_m = math.exp(pose[0])
    to_metres = np.diag([height_m, 1.0, 1.0])
    covariance = to_metres @ joint.covariance[:3, :3] @ to_metres
    return GroundPlane(height_m, float(pose[1]), float(pose[2]), covariance, source, joint=joint)


def _text(plane: GroundPlane) -> str:
    height_std_m, tilt_std, roll_std = (float(s) for s in np.sqrt(np.diag(plane.covariance)))
    tilt, roll = math.degrees(plane.tilt_rad), math.degrees(plane.roll_rad)
    return (
        f"height {plane.camera_height_m:.2f} \u00b1 {height_std_m:.2f} m, "
        f"tilt {tilt:.2f} \u00b1 {math.degrees(tilt_std):.2f} degrees, "
        f"roll {roll:.2f} \u00b1 {math.degrees(roll_std):.2f} degrees"
    )
