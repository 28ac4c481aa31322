"""A camera above flat ground: how far away, how tall, and where is what stands on it.

The camera is at height h_c, its optical axis tilted by t below the horizon and rotated by the roll.
Coordinates are undistorted and normalised: x right, y down, at unit distance along the axis. Depth
is Z, the distance of the foot along the optical axis. In the camera's frame the direction of gravity
is g = (sin roll cos t, cos roll cos t, sin t).

    Z = h_c / (y_f cos t + sin t)               the foot's ray meets the ground
    H = Z (y_f - y_h) / (cos t - y_h sin t)     the head's ray meets the vertical above the foot

after the roll has been removed (DESIGN, section 2; Hoiem et al. 2008 give the small-angle form).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike


def remove_roll(xy: ArrayLike, roll_rad: ArrayLike) -> Floats:
    """Return normalised points, (..., 2), as a camera without roll would see them."""
    points = np.asarray(xy, dtype=np.float64)
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    x, y = points[..., 0], points[..., 1]
    return np.stack([x * cos - y * sin, x * sin + y * cos], axis=-1)


def add_roll(xy: ArrayLike, roll_rad: ArrayLike) -> Floats:
    """Return normalised points, (..., 2), of an upright camera as a rolled one sees them."""
    return remove_roll(xy, -np.asarray(roll_rad, dtype=np.float64))


def foot_depth_m(camera_height_m: ArrayLike, tilt_rad: ArrayLike, y_foot: ArrayLike) -> Floats:
    """Return Z of a point on the ground; NaN at or above the horizon."""
    slope = np.asarray(y_foot, dtype=np.float64) * np.cos(tilt_rad) + np.sin(tilt_rad)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(slope > 0, np.asarray(camera_height_m, float) / slope, np.nan)


def height_m(
    depth_m: ArrayLike, y_foot: ArrayLike, y_head: ArrayLike, tilt_rad: ArrayLike
) -> Floats:
    """Return H of a vertical object that stands at depth Z."""
    y_f, y_h = np.asarray(y_foot, dtype=np.float64), np.asarray(y_head, dtype=np.float64)
    across = np.cos(tilt_rad) - y_h * np.sin(tilt_rad)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(across > 0, np.asarray(depth_m, float) * (y_f - y_h) / across, np.nan)


def depth_from_height_m(
    object_height_m: ArrayLike, y_foot: ArrayLike, y_head: ArrayLike, tilt_rad: ArrayLike
) -> Floats:
    """Return Z of a vertical object of known height, the tilt being known."""
    y_f, y_h = np.asarray(y_foot, dtype=np.float64), np.asarray(y_head, dtype=np.float64)
    across = np.cos(tilt_rad) - y_h * np.sin(tilt_rad)
    with np.errstate(invalid="ignore", divide="ignore"):
        depth = np.asarray(object_height_m, float) * across / (y_f - y_h)
    return np.where((y_f > y_h) & (across > 0), depth, np.nan)


def ground_position_m(
    depth_m: ArrayLike, x_foot: ArrayLike, y_foot: ArrayLike, tilt_rad: ArrayLike
) -> tuple[Floats, Floats]:
    """Return the foot's position on the ground: to the right of the camera, and ahead of it."""
    z_m = np.asarray(depth_m, dtype=np.float64)
    right_m = z_m * np.asarray(x_foot, dtype=np.float64)
    ahead_m = z_m * (np.cos(tilt_rad) - np.asarray(y_foot, float) * np.sin(tilt_rad))
    return np.asarray(right_m), np.asarray(ahead_m)


def range_m(
    x_m: ArrayLike, y_m: ArrayLike, camera_height_m: ArrayLike, point_height_m: ArrayLike = 0.0
) -> Floats:
    """Return the Euclidean distance from the camera to a point above a position on the ground."""
    drop_m = np.asarray(camera_height_m, float) - np.asarray(point_height_m, dtype=np.float64)
    x, y = np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64)
    return np.asarray(np.sqrt(x * x + y * y + drop_m * drop_m))


def project_person(
    x_m: ArrayLike,
    y_m: ArrayLike,
    object_height_m: ArrayLike,
    camera_height_m: ArrayLike,
    tilt_rad: ArrayLike,
    roll_rad: ArrayLike = 0.0,
) -> tuple[Floats, Floats]:
    """Return normalised foot and head points, (..., 2), of who stands at (x right, y ahead).

    What lies behind the image plane is NaN.
    """
    foot = _project(x_m, y_m, 0.0, camera_height_m, tilt_rad, roll_rad)
    head = _project(x_m, y_m, object_height_m, camera_height_m, tilt_rad, roll_rad)
    return foot, head


def _project(
    x_m: ArrayLike,
    y_m: ArrayLike,
    up_m: ArrayLike,
    camera_height_m: ArrayLike,
    tilt_rad: ArrayLike,
    roll_rad: ArrayLike,
) -> Floats:
    x, ahead = np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64)
    drop = np.asarray(camera_height_m, float) - np.asarray(up_m, dtype=np.float64)
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    z = ahead * cos + drop * sin
    down = drop * cos - ahead * sin
    with np.errstate(invalid="ignore", divide="ignore"):
        xy = np.stack(np.broadcast_arrays(x / z, down / z), axis=-1)
    return add_roll(np.where((z > 0)[..., None], xy, np.nan), roll_rad)


def depth_jacobian(
    camera_height_m: ArrayLike, tilt_rad: ArrayLike, x_foot: ArrayLike, y_foot: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return dZ by camera height, tilt, roll, and y_foot (points after the roll's removal).

    From Z = h_c / (y cos t + sin t); a roll moves y by x a radian.
    """
    z_m = foot_depth_m(camera_height_m, tilt_rad, y_foot)
    h_m, t = np.asarray(camera_height_m, dtype=np.float64), np.asarray(tilt_rad, dtype=np.float64)
    x, y = np.asarray(x_foot, dtype=np.float64), np.asarray(y_foot, dtype=np.float64)
    by_tilt = -(z_m**2) / h_m * (np.cos(t) - y * np.sin(t))
    by_y = -(z_m**2) / h_m * np.cos(t)
    return z_m / h_m, by_tilt, by_y * x, by_y


def height_jacobian(
    camera_height_m: ArrayLike, tilt_rad: ArrayLike, foot: ArrayLike, head: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Return dH by camera height, tilt, roll, y_foot and y_head (points, (..., 2), without roll)."""
    foot_xy, head_xy = np.asarray(foot, dtype=np.float64), np.asarray(head, dtype=np.float64)
    t = np.asarray(tilt_rad, dtype=np.float64)
    y_f, y_h = foot_xy[..., 1], head_xy[..., 1]
    z_m = foot_depth_m(camera_height_m, t, y_f)
    dz_h, dz_t, _, dz_y = depth_jacobian(camera_height_m, t, foot_xy[..., 0], y_f)
    across = np.cos(t) - y_h * np.sin(t)
    with np.errstate(invalid="ignore", divide="ignore"):
        per_depth = (y_f - y_h) / across
        by_y_foot = dz_y * per_depth + z_m / across
        by_y_head = z_m * (-1.0 / across + per_depth * np.sin(t) / across)
        by_tilt = dz_t * per_depth + z_m * per_depth * (np.sin(t) + y_h * np.cos(t)) / across
    by_roll = by_y_foot * foot_xy[..., 0] + by_y_head * head_xy[..., 0]
    return dz_h * per_depth, by_tilt, by_roll, by_y_foot, by_y_head
