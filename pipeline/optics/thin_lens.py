"""The thin lens: where it images an object, how large, and how blurred (the paper's Eqs. 1-10).

f focal length, s focus distance, v image distance, d depth of the object, a aperture radius,
N f-number. The sensor stands at v, the image distance of the focus distance.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike
Branch = Literal["near", "far"]


def image_distance_mm(focus_distance_m: ArrayLike, focal_length_mm: ArrayLike) -> Floats:
    """Return v = f s / (s - f), the image distance of the focus distance (Eq. 1).

    An infinite or unknown (NaN) focus distance gives v = f. A focus distance at or inside the focal
    length has no real image: NaN.
    """
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    s_mm = np.asarray(focus_distance_m, dtype=np.float64) * 1e3
    with np.errstate(invalid="ignore", divide="ignore"):
        v_mm = f_mm / (1.0 - f_mm / s_mm)
        v_mm = np.where(s_mm <= f_mm, np.nan, v_mm)
    return np.where(np.isnan(s_mm) | np.isinf(s_mm), f_mm, v_mm)


def object_distance_m(image_distance_mm: ArrayLike, focal_length_mm: ArrayLike) -> Floats:
    """Return the distance of the object that is sharp at an image distance (Eq. 2).

    v = f gives infinity; v < f has no real object: NaN.
    """
    v_mm = np.asarray(image_distance_mm, dtype=np.float64)
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        d_m = f_mm * v_mm / (v_mm - f_mm) * 1e-3
    return np.where(v_mm < f_mm, np.nan, d_m)


def aperture_radius_mm(focal_length_mm: ArrayLike, f_number: ArrayLike) -> Floats:
    """Return a = f / (2 N) (below Eq. 10). The paper prints millimetres as "cm"."""
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(f_mm / (2.0 * np.asarray(f_number, dtype=np.float64)))


def magnification(depth_m: ArrayLike, focal_length_mm: ArrayLike) -> Floats:
    """Return m = f / (d - f), exact for a lens focused on the object (Eqs. 1 and 11).

    The paper's Eq. 12 takes f / d instead. Inside the focal length there is no real image: NaN.
    """
    d_mm = np.asarray(depth_m, dtype=np.float64) * 1e3
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(d_mm > f_mm, f_mm / (d_mm - f_mm), np.nan)


def blur_radius_um(
    depth_m: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike = np.inf,
) -> Floats:
    """Return the radius of the blur circle of a point (Eqs. 3-8, for any focus distance).

    Similar triangles behind the lens, a / v_d = r / |v - v_d|, with 1 / v_d = 1 / f - 1 / d:
    r = a v |1/f - 1/d - 1/v|. At infinite focus this is f a / d.
    """
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    d_mm = np.asarray(depth_m, dtype=np.float64) * 1e3
    v_mm = image_distance_mm(focus_distance_m, f_mm)
    with np.errstate(invalid="ignore", divide="ignore"):
        # 1/f - 1/v is 1/s; written with s it does not cancel at infinite focus
        vergence = np.abs(_inverse_mm(focus_distance_m) - 1.0 / d_mm)
        r_mm = aperture_radius_mm(f_mm, f_number) * v_mm * vergence
    return np.where(d_mm > 0, r_mm * 1e3, np.nan)


def circle_of_confusion_um(
    depth_m: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike = np.inf,
) -> Floats:
    """Return the diameter of the blur circle: twice `blur_radius_um`."""
    return 2.0 * blur_radius_um(depth_m, focal_length_mm, f_number, focus_distance_m)


def depth_from_blur_m(
    blur_radius_um: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike = np.inf,
    branch: Branch = "near",
) -> Floats:
    """Return the depth at which a point has this blur (Eqs. 9-10, for any focus distance).

    `near` is in front of the plane of focus, `far` behind it. 1/d = 1/s +- r / (a v). At infinite
    focus only `near` exists, and it is Eq. 10: d = f a / r. A far blur larger than that of a point
    at infinity belongs to no depth: NaN.
    """
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    v_mm = image_distance_mm(focus_distance_m, f_mm)
    r_mm = np.asarray(blur_radius_um, dtype=np.float64) * 1e-3
    sign = 1.0 if branch == "near" else -1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        vergence = r_mm / (aperture_radius_mm(f_mm, f_number) * v_mm)
        inverse_d_mm = _inverse_mm(focus_distance_m) + sign * vergence
        d_m = 1e-3 / inverse_d_mm
    return np.where((inverse_d_mm >= 0) & (r_mm >= 0), d_m, np.nan)


def hyperfocal_distance_m(
    focal_length_mm: ArrayLike, f_number: ArrayLike, circle_of_confusion_um: ArrayLike
) -> Floats:
    """Return H = f^2 / (N c) + f: focused there, infinity is just sharp (Kingslake, ch. 6)."""
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    c_mm = np.asarray(circle_of_confusion_um, dtype=np.float64) * 1e-3
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((f_mm**2 / (np.asarray(f_number) * c_mm) + f_mm) * 1e-3)


def depth_of_field_m(
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike,
    circle_of_confusion_um: ArrayLike,
) -> tuple[Floats, Floats]:
    """Return the nearest and farthest depth that are blurred by no more than a circle; far may be inf."""
    radius_um = np.asarray(circle_of_confusion_um, dtype=np.float64) / 2
    near_m = depth_from_blur_m(radius_um, focal_length_mm, f_number, focus_distance_m, "near")
    far_m = depth_from_blur_m(radius_um, focal_length_mm, f_number, focus_distance_m, "far")
    return near_m, np.where(np.isnan(far_m) & ~np.isnan(near_m), np.inf, far_m)


def _inverse_mm(focus_distance_m: ArrayLike) -> Floats:
    """Return 1 / s in 1/mm: zero for an infinite or unknown focus distance."""
    s_m = np.asarray(focus_distance_m, dtype=np.float64)
    with np.errstate(divide="ignore"):
        return np.where(np.isnan(s_m) | np.isinf(s_m), 0.0, 1e-3 / s_m)
