"""The covariance of a pose from walkers together with what biases their boxes, in parts.

What was fitted has the covariance of `walkers.covariance`. Biases that cannot be fitted, as they would
only shrink the scene, are considered (Tapley, Schutz and Born, section 6.5): each moves the fit by what
it does to the residuals, and the measurements of pass 2 by itself; both come together in one column.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.optimize import OptimizeResult

from pipeline.calibrate.walkers import model
from pipeline.calibrate.walkers.bordered_solver import Bordered, inverse_of, steepness_of
from pipeline.calibrate.walkers.covariance import (
    ALL_PER_EXCESS,
    NEAR_PER_EXCESS,
    SIDE_PER_EXCESS,
    bent_residuals,
    box_excess,
    fitted_covariance,
)
from pipeline.calibrate.walkers.model import Sample, Scale
from pipeline.core.arrays import FloatArray
from pipeline.core.records import RANK, Error, GroundPlane, JointErrors
from pipeline.estimate.boxes.error_correlation import BOX_COMMON_STD
from pipeline.estimate.boxes.joint_slopes import log_slopes
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.types import Measured
from pipeline.optics.ground_plane import foot_depth_m, remove_roll

# A calibrated focal length is that of its focus and its day: 0.2-0.8 % between calibrations of a lens.
FOCAL_STD = 0.005
# Where the fitted unknowns stand in the model's order; a side that is fitted is a bias of boxes, and what
# pass 2 measures is not freed of it nor of the common reach: its error has the other sign.
_FITTED = {
    model.ABOVE: (Error.LOG_HEIGHT, 1.0),
    model.TILT: (Error.TILT, 1.0),
    model.ROLL: (Error.ROLL, 1.0),
    model.REACH: (Error.REACH, 1.0),
    model.SIDE: (Error.SIDE, -1.0),
}


def joint_errors(
    fit: OptimizeResult, sample: Sample, scale: Scale, measured: Measured, plane: GroundPlane
) -> JointErrors:
    """Return what the pose of a fit and its boxes have in common.

    Args:
        fit: of `model.residuals`, without a focal length.
        sample: the observations it was made from.
        scale: what was known beside them.
        measured: the same people's observations.
        plane: the pose of the fit.
    """
    slopes = Bordered.of(fit.jac, sample)
    inverse = inverse_of(slopes.shared.T @ slopes.shared)
    to_errors = np.zeros((len(Error), len(inverse)))
    for unknown, (error, sign) in _FITTED.items():
        if unknown != model.SIDE or len(scale.uprights):
            to_errors[error, unknown] = sign
    by_mean = inverse @ slopes.shared[_row_of_mean(sample)]
    of_fit = fitted_covariance(fit, sample, scale)
    scale_part = to_errors @ by_mean[:, None]
    rest = factor_of(to_errors @ of_fit @ to_errors.T - scale_part @ scale_part.T)
    near_log_m, right = _references(fit, sample)
    to_fit = to_errors @ inverse @ slopes.shared.T * steepness_of(fit.fun)
    columns: dict[Error, FloatArray] = {}
    for error, (change, std) in _biases(fit, sample, scale, near_log_m).items():
        column = -to_fit @ change
        column[error] += 1.0
        columns[error] = column * std
    boxes = [c for e, c in columns.items() if e not in (Error.BEND, Error.LOG_FOCAL)]
    lens = [c for e, c in columns.items() if e in (Error.BEND, Error.LOG_FOCAL)]
    camera = np.column_stack([rest, *lens])
    joint = JointErrors(
        scale_part, camera, np.column_stack(boxes), np.empty((len(Error), 0)), near_log_m, *right
    )
    served = _slopes_of_people(measured, plane, sample, joint)
    return replace(joint, low_rank=low_rank(scale_part, np.hstack([camera, joint.boxes]), served))


def _row_of_mean(sample: Sample) -> int:
    """Return which residual is the prior on the mean of the people here: the second of `Scale.few`."""
    return len(sample.track) + sample.people + 1


def _references(fit: OptimizeResult, sample: Sample) -> tuple[float, tuple[float, float]]:
    foot = remove_roll(sample.foot, fit.x[model.ROLL])
    depth_m = foot_depth_m(np.exp(fit.x[model.ABOVE]), fit.x[model.TILT], foot[:, 1])
    column = foot[:, 0]
    right = float(column.mean()), max(float(column.std()), 1e-6)
    return float(np.nanmean(np.log(depth_m))), right


def _biases(
    fit: OptimizeResult, sample: Sample, scale: Scale, near_log_m: float
) -> dict[Error, tuple[FloatArray, float]]:
    """Return what one unit of each considered bias does to the residuals, and its deviation."""
    excess = box_excess(fit, sample)
    y_f = remove_roll(sample.foot, fit.x[model.ROLL])[:, 1]
    depth_m = foot_depth_m(np.exp(fit.x[model.ABOVE]), fit.x[model.TILT], y_f)
    near = np.nan_to_num(near_log_m - np.log(depth_m))
    box = sample.foot[:, 1] - sample.head[:, 1]

    def moved(foot: FloatArray, head: FloatArray) -> FloatArray:
        """Return the change of residuals when rows move by so much a unit, (rows,)."""
        step = 1e-4
        other = replace(
            sample,
            foot=sample.foot + step * np.column_stack([0 * foot, foot]),
            head=sample.head + step * np.column_stack([0 * head, head]),
        )
        change = model.residuals(fit.x, other, scale) - model.residuals(fit.x, sample, scale)
        return np.asarray(change / step)

    none = np.zeros(len(box))
    near_std = NEAR_PER_EXCESS * excess / np.sqrt(2)
    biases = {
        Error.ALL: (moved(none, -box), float(np.hypot(BOX_COMMON_STD, ALL_PER_EXCESS * excess))),
        Error.NEAR_HEAD: (moved(none, -box * near), near_std),
        Error.NEAR_FOOT: (moved(box * near, none), near_std),
        # The lens has a bend that was left out: the points seen are where they should not be.
        Error.BEND: (-bent_residuals(fit.x, sample, scale), scale.bend_std),
        Error.LOG_FOCAL: (moved(-sample.foot[:, 1], -sample.head[:, 1]), FOCAL_STD),
    }
    if not len(scale.uprights):
        side = moved(none, -box * sample.trends[:, 0])
        biases[Error.SIDE] = (side, SIDE_PER_EXCESS * excess)
    return biases


def _slopes_of_people(
    measured: Measured, plane: GroundPlane, sample: Sample, joint: JointErrors
) -> FloatArray:
    """Return the slopes that the low rank must serve: of each person's height, and of their depths."""
    posed = replace(measured, ground_plane=plane).take(np.isin(measured.track_id, sample.track_id))
    depth, height = log_slopes(with_reach(posed), joint)
    tall = pd.DataFrame(height).groupby(posed.track_id).median().dropna()
    away = pd.DataFrame(depth).groupby(posed.track_id).median().dropna()
    return np.vstack([tall.to_numpy(), away.to_numpy()])


def factor_of(covariance: FloatArray) -> FloatArray:
    """Return F with F F' = C, (n, n), of a covariance that may be singular."""
    value, vector = np.linalg.eigh((covariance + covariance.T) / 2)
    return np.asarray(vector * np.sqrt(np.maximum(value, 0.0)))


def low_rank(scale: FloatArray, rest: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return a factor of RANK columns, (10, RANK), that serves these slopes, (m, 10), best.

    The first column is the scale's; the others are the leading right singular vectors of what the rest
    does to the slopes (Eckart and Young 1936).
    """
    _, _, right = np.linalg.svd(slopes @ rest, full_matrices=True)
    others = rest @ right[: RANK - 1].T
    missing = RANK - 1 - others.shape[1]
    return np.hstack([scale, others, np.zeros((len(scale), max(missing, 0)))])
