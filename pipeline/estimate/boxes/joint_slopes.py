"""Slopes of depths and heights by the ground over what pose and boxes have in common.

With y the rows of foot and head (normalised, y down), j the derivatives of `optics.ground_plane` by
camera height, tilt, roll and both rows, and h = y_f - y_h how tall the box is: a head that is too high
by a share b of that has its row off by -b h, a foot that is too low by +b h; a focal length too long by
q makes rows smaller by q; without a bend k that the lens has, points are off by -k r^2.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.records import Error, JointErrors
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.optics.ground_plane import depth_jacobian, foot_depth_m, height_jacobian, height_m


def log_slopes(geometry: Geometry, joint: JointErrors) -> tuple[FloatArray, FloatArray]:
    """Return d log depth and d log height by each of `Error`, (n, 10) each; the pose must be known.

    NaN where there is no place on the ground.
    """
    plane = geometry.measured.ground_plane
    if plane is None:
        raise ValueError("slopes over a pose need one")
    foot, head = geometry.foot, geometry.head
    above_m, tilt = plane.camera_height_m, plane.tilt_rad
    y_f, y_h = foot[:, 1], head[:, 1]
    depth_m = foot_depth_m(above_m, tilt, y_f)
    tall_m = height_m(depth_m, y_f, y_h, tilt)
    by_depth = np.stack(depth_jacobian(above_m, tilt, foot[:, 0], y_f), axis=1)
    by_height = np.stack(height_jacobian(above_m, tilt, foot, head), axis=1)
    box = y_f - y_h
    with np.errstate(invalid="ignore", divide="ignore"):
        near = joint.near_log_m - np.log(depth_m)
        right = (foot[:, 0] - joint.right_mean) / joint.right_std
        bent_f, bent_h = (y * (p**2).sum(axis=1) for y, p in ((y_f, foot), (y_h, head)))
        zero = np.zeros(len(box))
        # By the row of the foot alone, then by that of the head.
        foot_of = {
            Error.NEAR_FOOT: box * near,
            Error.BEND: -bent_f,
            Error.LOG_FOCAL: -y_f,
        }
        head_of = {
            Error.SIDE: -box * right,
            Error.NEAR_HEAD: -box * near,
            Error.ALL: -box,
            Error.BEND: -bent_h,
            Error.LOG_FOCAL: -y_h,
        }
        depth, height = np.zeros((2, len(box), len(Error)))
        for error in Error:
            moved_f, moved_h = foot_of.get(error, zero), head_of.get(error, zero)
            depth[:, error] = by_depth[:, 3] * moved_f
            height[:, error] = by_height[:, 3] * moved_f + by_height[:, 4] * moved_h
        for error, scale in ((Error.LOG_HEIGHT, above_m), (Error.TILT, 1.0), (Error.ROLL, 1.0)):
            depth[:, error] = by_depth[:, error] * scale
            height[:, error] = by_height[:, error] * scale
        depth[:, Error.REACH] = geometry.reach_m
        height[:, Error.REACH] = by_height[:, 3] / by_depth[:, 3] * geometry.reach_m
        return depth / depth_m[:, None], height / tall_m[:, None]
