"""Geometry of a camera above flat ground: depth, height and position of objects that stand on it.

The camera is at height h_c, its optical axis tilted by t below the horizon and rotated by the roll.
Coordinates are undistorted and normalised: x right, y down, at unit distance along the axis. Depth
is Z, the distance of the foot along the optical axis. In the camera's frame the direction of gravity
is g = (sin roll cos t, cos roll cos t, sin t).

    Z = h_c / (y_f cos t + sin t)                   the foot's ray meets the ground
    H = Z (y_f - y_h) / (cos t - y_h sin t)         the head's ray meets the vertical above the foot
    Z = H (cos t - y_h sin t) / (y_f - y_h)         the same, H being known

after the roll has been removed (Hoiem et al. 2008 give the small-angle form).
The pose is (camera height in m, tilt, roll), its covariance (3, 3) in that order.
"""

from __future__ import annotations

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet


@quiet
def remove_roll(xy: ArrayLike, roll_rad: ArrayLike) -> Floats:
    """Return normalised points, (..., 2), as a camera without roll would see them."""
    points = floats(xy)
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    x, y = points[..., 0], points[..., 1]
    return np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1)


@quiet
def add_roll(xy: ArrayLike, roll_rad: ArrayLike) -> Floats:
    """Return normalised points, (..., 2), of an upright camera as a rolled one sees them."""
    return remove_roll(xy, -floats(roll_rad))


@quiet
def horizon_y(tilt_rad: ArrayLike, x: ArrayLike = 0.0, roll_rad: ArrayLike = 0.0) -> Floats:
    """Return the row of the horizon at a column, both normalised and as seen with the roll."""
    return np.asarray((-np.tan(tilt_rad) - floats(x) * np.sin(roll_rad)) / np.cos(roll_rad))


@quiet
def foot_depth_m(camera_height_m: ArrayLike, tilt_rad: ArrayLike, y_foot: ArrayLike) -> Floats:
    """Return Z of a point on the ground; NaN at or above the horizon."""
    slope = floats(y_foot) * np.cos(tilt_rad) + np.sin(tilt_rad)
    return np.asarray(positive(camera_height_m) / positive(slope))


@quiet
def height_m(
    depth_m: ArrayLike, y_foot: ArrayLike, y_head: ArrayLike, tilt_rad: ArrayLike
) -> Floats:
    """Return H of a vertical object that stands at depth Z; NaN where the head's ray leads back."""
    return np.asarray(
        floats(depth_m) * (floats(y_foot) - floats(y_head)) / _ahead(y_head, tilt_rad)
    )


@quiet
def depth_from_height_m(
    object_height_m: ArrayLike, y_foot: ArrayLike, y_head: ArrayLike, tilt_rad: ArrayLike
) -> Floats:
    """Return Z of a vertical object of known height, the tilt being known."""
    tall = positive(floats(y_foot) - floats(y_head))
    return np.asarray(floats(object_height_m) * _ahead(y_head, tilt_rad) / tall)


@quiet
def ground_position_m(
    depth_m: ArrayLike, x_foot: ArrayLike, y_foot: ArrayLike, tilt_rad: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the foot's position on the ground: to the right of the camera, and ahead of it."""
    z_m = floats(depth_m)
    ahead_m = z_m * (np.cos(tilt_rad) - floats(y_foot) * np.sin(tilt_rad))
    return np.asarray(z_m * floats(x_foot)), np.asarray(ahead_m)


@quiet
def range_m(
    x_m: ArrayLike, y_m: ArrayLike, camera_height_m: ArrayLike, point_height_m: ArrayLike = 0.0
) -> Floats:
    """Return the Euclidean distance from the camera to a point above a position on the ground."""
    drop_m = floats(camera_height_m) - floats(point_height_m)
    return np.asarray(np.hypot(np.hypot(floats(x_m), floats(y_m)), drop_m))


@quiet
def project_person(
    x_m: ArrayLike,
    y_m: ArrayLike,
    object_height_m: ArrayLike,
    camera_height_m: ArrayLike,
    tilt_rad: ArrayLike,
    roll_rad: ArrayLike = 0.0,
) -> tuple[Floats, Floats]:
    """Return normalised foot and head points, (..., 2), of a person at (x right, y ahead).

    What lies behind the image plane is NaN.
    """
    foot = _project(x_m, y_m, 0.0, camera_height_m, tilt_rad, roll_rad)
    head = _project(x_m, y_m, object_height_m, camera_height_m, tilt_rad, roll_rad)
    return foot, head


@quiet
def _project(
    x_m: ArrayLike,
    y_m: ArrayLike,
    up_m: ArrayLike,
    camera_height_m: ArrayLike,
    tilt_rad: ArrayLike,
    roll_rad: ArrayLike,
) -> Floats:
    ahead_m, drop_m = floats(y_m), floats(camera_height_m) - floats(up_m)
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    z_m = positive(ahead_m * cos + drop_m * sin)
    down_m = drop_m * cos - ahead_m * sin
    return add_roll(np.stack(np.broadcast_arrays(floats(x_m) / z_m, down_m / z_m), -1), roll_rad)


@quiet
def depth_jacobian(
    camera_height_m: ArrayLike, tilt_rad: ArrayLike, x_foot: ArrayLike, y_foot: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return dZ by camera height, tilt, roll, and y_foot (points after the roll's removal).

    From Z = h_c / (y cos t + sin t); a roll moves y by x a radian.
    """
    z_m = foot_depth_m(camera_height_m, tilt_rad, y_foot)
    h_m, t = floats(camera_height_m), floats(tilt_rad)
    by_tilt = -(z_m**2) / h_m * (np.cos(t) - floats(y_foot) * np.sin(t))
    by_y = -(z_m**2) / h_m * np.cos(t)
    return (
        np.asarray(z_m / h_m),
        np.asarray(by_tilt),
        np.asarray(by_y * floats(x_foot)),
        np.asarray(by_y),
    )


@quiet
def height_jacobian(
    camera_height_m: ArrayLike, tilt_rad: ArrayLike, foot: ArrayLike, head: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return dH by camera height, tilt, roll, y_foot and y_head (points, (..., 2), without roll)."""
    foot_xy, head_xy, t = floats(foot), floats(head), floats(tilt_rad)
    y_f, y_h = foot_xy[..., 1], head_xy[..., 1]
    z_m = foot_depth_m(camera_height_m, t, y_f)
    dz_h, dz_t, _, dz_y = depth_jacobian(camera_height_m, t, foot_xy[..., 0], y_f)
    ahead = _ahead(y_h, t)
    per_depth = (y_f - y_h) / ahead
    by_y_foot = dz_y * per_depth + z_m / ahead
    by_y_head = z_m * (per_depth * np.sin(t) - 1.0) / ahead
    by_tilt = dz_t * per_depth + z_m * per_depth * (np.sin(t) + y_h * np.cos(t)) / ahead
    by_roll = by_y_foot * foot_xy[..., 0] + by_y_head * head_xy[..., 0]
    return (
        np.asarray(dz_h * per_depth),
        np.asarray(by_tilt),
        np.asarray(by_roll),
        np.asarray(by_y_foot),
        np.asarray(by_y_head),
    )


@quiet
def depth_from_height_jacobian(
    object_height_m: ArrayLike, tilt_rad: ArrayLike, foot: ArrayLike, head: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return dZ of `depth_from_height_m` by object height, tilt, roll, y_foot and y_head."""
    foot_xy, head_xy, t = floats(foot), floats(head), floats(tilt_rad)
    y_h, tall = head_xy[..., 1], positive(foot_xy[..., 1] - head_xy[..., 1])
    by_object = _ahead(y_h, t) / tall
    per_m = floats(object_height_m) / tall
    by_y_foot = -per_m * by_object
    by_y_head = per_m * (by_object - np.sin(t))
    by_tilt = -per_m * (np.sin(t) + y_h * np.cos(t))
    by_roll = by_y_foot * foot_xy[..., 0] + by_y_head * head_xy[..., 0]
    return (
        np.asarray(by_object),
        np.asarray(by_tilt),
        np.asarray(by_roll),
        np.asarray(by_y_foot),
        np.asarray(by_y_head),
    )


@quiet
def foot_depth_std_m(
    camera_height_m: ArrayLike,
    tilt_rad: ArrayLike,
    foot: ArrayLike,
    foot_std: ArrayLike,
    pose_covariance: ArrayLike,
) -> Floats:
    """Return the standard deviation of `foot_depth_m` to first order.

    `foot` (..., 2) is without roll, `foot_std` the normalised noise of its row.
    """
    x_f, y_f = floats(foot)[..., 0], floats(foot)[..., 1]
    *by_pose, by_foot = depth_jacobian(camera_height_m, tilt_rad, x_f, y_f)
    return np.asarray(
        np.sqrt(_common(by_pose, pose_covariance) + (by_foot * floats(foot_std)) ** 2)
    )


@quiet
def height_std_m(
    camera_height_m: ArrayLike,
    tilt_rad: ArrayLike,
    foot: ArrayLike,
    head: ArrayLike,
    foot_std: ArrayLike,
    head_std: ArrayLike,
    pose_covariance: ArrayLike,
) -> Floats:
    """Return the standard deviation of `height_m` at the foot's depth, to first order."""
    *by_pose, by_foot, by_head = height_jacobian(camera_height_m, tilt_rad, foot, head)
    noise = (by_foot * floats(foot_std)) ** 2 + (by_head * floats(head_std)) ** 2
    return np.asarray(np.sqrt(_common(by_pose, pose_covariance) + noise))


def _ahead(y: ArrayLike, tilt_rad: ArrayLike) -> Floats:
    """Return how far a ray gets over the ground per unit of depth; NaN if not ahead."""
    return positive(np.cos(tilt_rad) - floats(y) * np.sin(tilt_rad))


def _common(by_pose: list[Floats], pose_covariance: ArrayLike) -> Floats:
    """Return j C j^T, the variance that the pose's uncertainty gives."""
    j = np.stack(np.broadcast_arrays(*by_pose), axis=-1)
    return np.asarray(np.einsum("...i,ij,...j->...", j, floats(pose_covariance), j))
