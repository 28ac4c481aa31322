"""A known height of a person who had no part in the fit of a pose, brought in afterwards.

The fit takes only people who are seen whole for long enough. Of any other whose height is known, pass 2's
own measurement says how far the scene is off: with the slopes s of that height over the unknowns of
`core.records.Error`, of covariance C, and v the variance of the difference, the unknowns move by
C s / v times it, and C becomes C - C s s' C / v (conditioning of a normal distribution).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.calibrate.walkers.known_lengths import KnownHeight
from pipeline.core.arrays import FloatArray
from pipeline.core.config import Config
from pipeline.core.errors import UsageError
from pipeline.core.records import Error, GroundPlane, JointErrors
from pipeline.estimate.boxes.joint_slopes import log_slopes
from pipeline.estimate.boxes.quality import assess
from pipeline.estimate.boxes.reach import with_reach
from pipeline.estimate.gait import GAIT_DROP_M, GAIT_DROP_STD_M
from pipeline.estimate.methods import ground
from pipeline.estimate.types import Measured


def conditioned(plane: GroundPlane, measured: Measured, person: KnownHeight) -> GroundPlane:
    """Return a pose that knows the height of one person more.

    Args:
        plane: the pose, with its joint errors.
        measured: observations of its camera, this person's among them.
        person: whose height is known.

    Raises:
        UsageError: the person is nowhere seen from head to feet.
    """
    joint = plane.joint
    if joint is None:
        return plane
    mine = replace(measured.only(np.array([person.track_id])), ground_plane=plane)
    geometry = ground.with_scatter(with_reach(assess(mine).applied(mine)), Config())
    found = ground.estimate(geometry, Config())
    _, slopes = log_slopes(geometry, joint)
    seen = np.isfinite(found.height_m) & np.isfinite(slopes).all(axis=1)
    if not seen.any():
        raise UsageError(
            f"track {person.track_id} is nowhere seen from head to feet, so its height tells nothing",
            remedy="Give the height of another person",
        )
    tall_m = float(np.median(found.height_m[seen]))
    own_m = np.hypot(person.std_m, GAIT_DROP_STD_M)
    variance = float(np.median(found.height_common_std_m[seen]) ** 2 + own_m**2) / tall_m**2
    slope = np.median(slopes[seen], axis=0)
    off = float(np.log(tall_m / (person.height_m - GAIT_DROP_M)))
    moved = joint.covariance @ slope / max(variance, float(slope @ joint.covariance @ slope)) * off
    joint = narrowed(joint, slope, variance)
    above_m = plane.camera_height_m * float(np.exp(-moved[Error.LOG_HEIGHT]))
    to_metres = np.diag([above_m, 1.0, 1.0])
    return replace(
        plane,
        camera_height_m=above_m,
        tilt_rad=plane.tilt_rad - float(moved[Error.TILT]),
        roll_rad=plane.roll_rad - float(moved[Error.ROLL]),
        covariance=to_metres @ joint.covariance[:3, :3] @ to_metres,
        joint=joint,
    )


def narrowed(joint: JointErrors, slope: FloatArray, variance: float) -> JointErrors:
    """Return the parts of the covariance after the observation of what has a slope, (10,).

    `variance` is that of the difference: of what is observed and of the observation.
    """
    parts = (joint.scale, joint.camera, joint.boxes)
    ends = np.cumsum([part.shape[1] for part in parts])[:-1]
    scale, camera, boxes = np.split(_after(np.hstack(parts), slope, variance), ends, axis=1)
    few = _after(joint.low_rank, slope, variance)
    return replace(joint, scale=scale, camera=camera, boxes=boxes, low_rank=few)


def _after(factor: FloatArray, slope: FloatArray, variance: float) -> FloatArray:
    """Return F (I - a a' / v)^(1/2), a = F' s: a factor of C - C s s' C / v."""
    along = factor.T @ slope
    squared = float(along @ along)
    if squared <= 0:
        return factor
    left = np.sqrt(max(1.0 - squared / variance, 0.0))
    return np.asarray(factor - (1.0 - left) / squared * np.outer(factor @ along, along))
