"""Depth and height from where an object stands on the ground (`optics.ground_plane`).

The foot's ray meets the ground at Z = h / (y_f cos t + sin t) along the axis, h above it and tilted by t;
the head above it is H = Z (y_f - y_h) / (cos t - y_h sin t) high.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.config import Config
from pipeline.estimate.boxes.geometry import Geometry
from pipeline.estimate.boxes.joint_slopes import log_slopes
from pipeline.estimate.boxes.scatter import scatter_of
from pipeline.estimate.methods.scaling import pose_variance
from pipeline.estimate.types import Estimated
from pipeline.optics.ground_plane import (
    depth_jacobian,
    foot_depth_m,
    ground_position_m,
    height_jacobian,
    height_m,
    range_m,
)
from pipeline.optics.silhouette import REACH_COMMON_STD, REACH_TRACK_STD


def estimate(geometry: Geometry, _config: Config) -> Estimated:
    """Return depths, heights and positions of what stands on the ground; the pose must be known.

    Where the picture cuts off the feet there is no depth; where it cuts off the head, no height.
    """
    m = geometry.measured
    plane = m.ground_plane
    if plane is None or m.intrinsics is None:
        return Estimated.unknown(len(m))
    foot, head = geometry.foot, geometry.head
    x_f, y_f, y_h = foot[:, 0], foot[:, 1], head[:, 1]
    h_m, tilt = plane.camera_height_m, plane.tilt_rad
    depth_m = foot_depth_m(h_m, tilt, y_f)
    tall_m = height_m(depth_m, y_f, y_h, tilt)

    by_pose = np.stack(depth_jacobian(h_m, tilt, x_f, y_f), axis=1)
    tall_by = np.stack(height_jacobian(h_m, tilt, foot, head), axis=1)
    depth_common, tall_common = _in_common(geometry, depth_m, tall_m, by_pose, tall_by)
    # How far a foot is before the axis differs by person.
    reach_std_m = REACH_TRACK_STD * geometry.reach_m
    depth_common += reach_std_m**2
    tall_common += (tall_by[:, 3] / by_pose[:, 3] * reach_std_m) ** 2
    if geometry.reach is not None:
        foot_std, head_std = geometry.common_std.T
        tall_common += (tall_by[:, 3] * foot_std) ** 2 + (tall_by[:, 4] * head_std) ** 2
        depth_common += (by_pose[:, 3] * foot_std) ** 2
    depth_std_m = np.sqrt(depth_common + (by_pose[:, 3] * geometry.foot_std) ** 2)
    noise = (tall_by[:, 3] * geometry.foot_std) ** 2 + (tall_by[:, 4] * geometry.head_std) ** 2

    footless = m.truncated[:, 3]
    depth_m = np.where(footless, np.nan, depth_m)
    no_height = m.height_cut
    tall_m = np.where(no_height, np.nan, tall_m)
    x_m, y_m = ground_position_m(depth_m, x_f, y_f, tilt)
    half_m = np.where(np.isnan(tall_m), 0.85, tall_m / 2)
    return replace(
        Estimated.unknown(len(m)),
        depth_m=depth_m,
        depth_std_m=np.where(footless, np.nan, depth_std_m),
        depth_common_std_m=np.where(footless, 0.0, np.sqrt(depth_common)),
        height_m=tall_m,
        height_std_m=np.where(no_height, np.nan, np.sqrt(tall_common + noise)),
        height_common_std_m=np.where(no_height, 0.0, np.sqrt(tall_common)),
        x_m=x_m,
        y_m=y_m,
        range_m=range_m(x_m, y_m, h_m, half_m),
    )


def _in_common(
    geometry: Geometry,
    depth_m: FloatArray,
    tall_m: FloatArray,
    by_pose: FloatArray,
    tall_by: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the variances of depth and height by what all of the camera have in common, (n,) each."""
    plane = geometry.measured.ground_plane
    if plane is None:
        return np.zeros(len(depth_m)), np.zeros(len(depth_m))
    if plane.joint is not None:
        of_depth, of_height = log_slopes(geometry, plane.joint)
        return (
            plane.joint.variance(of_depth) * depth_m**2,
            plane.joint.variance(of_height) * tall_m**2,
        )
    # A longer focal length makes rows smaller: dy = -y d(log f).
    y_f, y_h = geometry.foot[:, 1], geometry.head[:, 1]
    depth = pose_variance(by_pose[:, :3], -y_f * by_pose[:, 3], plane)
    by_focal = -(y_f * tall_by[:, 3] + y_h * tall_by[:, 4])
    tall = pose_variance(tall_by[:, :3], by_focal, plane)
    # How far feet are before the axis differs by what all of them wear, too.
    reach_std_m = REACH_COMMON_STD * geometry.reach_m
    return depth + reach_std_m**2, tall + (tall_by[:, 3] / by_pose[:, 3] * reach_std_m) ** 2


def with_scatter(geometry: Geometry, config: Config) -> Geometry:
    """Return the geometry with the boxes as good as the heights of their tracks say."""
    m, plane = geometry.measured, geometry.measured.ground_plane
    if plane is None or m.intrinsics is None:
        return geometry
    tall_by = height_jacobian(plane.camera_height_m, plane.tilt_rad, geometry.foot, geometry.head)
    swing_m = np.abs(tall_by[3]) * geometry.swing_std
    scatter = scatter_of(m, estimate(geometry, config), swing_m)
    return geometry.with_scatter(scatter)
