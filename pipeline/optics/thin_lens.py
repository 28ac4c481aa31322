"""The thin lens: image distance, magnification and blur of an object (the paper's Eqs. 1-10).

f focal length, s focus distance, v image distance, d depth of the object, a aperture radius,
N f-number. The sensor stands at v, the image distance of the focus distance.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet

Branch = Literal["near", "far"]


@quiet
def image_distance_mm(focus_distance_m: ArrayLike, focal_length_mm: ArrayLike) -> Floats:
    """Return v = f s / (s - f), the image distance of the focus distance (Eq. 1).

    An infinite or unknown (NaN) focus distance gives v = f. A focus distance at or inside the focal
    length has no real image: NaN.
    """
    f_mm = positive(focal_length_mm)
    s_mm = floats(focus_distance_m) * 1e3
    v_mm = np.where(s_mm > f_mm, f_mm / (1.0 - f_mm / s_mm), np.nan)
    return np.where(np.isnan(s_mm), f_mm, v_mm)


@quiet
def object_distance_m(image_distance_mm: ArrayLike, focal_length_mm: ArrayLike) -> Floats:
    """Return f v / (v - f), the distance of the object that is sharp at an image distance (Eq. 2).

    v = f gives infinity; v < f has no real object: NaN.
    """
    v_mm, f_mm = floats(image_distance_mm), positive(focal_length_mm)
    return np.where(v_mm >= f_mm, f_mm / (1.0 - f_mm / v_mm) * 1e-3, np.nan)


@quiet
def aperture_radius_mm(focal_length_mm: ArrayLike, f_number: ArrayLike) -> Floats:
    """Return a = f / (2 N) (below Eq. 10). The paper prints millimetres as "cm"."""
    return np.asarray(positive(focal_length_mm) / (2.0 * positive(f_number)))


@quiet
def magnification(depth_m: ArrayLike, focal_length_mm: ArrayLike) -> Floats:
    """Return m = f / (d - f), exact for a lens focused on the object (Eqs. 1 and 11).

    The paper's Eq. 12 takes f / d instead. Inside the focal length there is no real image: NaN.
    """
    d_mm, f_mm = floats(depth_m) * 1e3, positive(focal_length_mm)
    return np.where(d_mm > f_mm, f_mm / (d_mm - f_mm), np.nan)


@quiet
def blur_radius_um(
    depth_m: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike = np.inf,
) -> Floats:
    """Return the radius of the blur circle of a point (Eqs. 3-8, for any focus distance).

    Similar triangles behind the lens, a / v_d = r / |v - v_d|, with 1 / v_d = 1 / f - 1 / d:
    r = a v |1/s - 1/d|. At infinite focus this is f a / d.
    """
    d_mm = positive(depth_m) * 1e3
    per_vergence = _radius_per_vergence_mm2(focal_length_mm, f_number, focus_distance_m)
    return np.asarray(per_vergence * np.abs(_inverse_mm(focus_distance_m) - 1.0 / d_mm) * 1e3)


@quiet
def circle_of_confusion_um(
    depth_m: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike = np.inf,
) -> Floats:
    """Return the diameter of the blur circle: twice `blur_radius_um`."""
    return np.asarray(2.0 * blur_radius_um(depth_m, focal_length_mm, f_number, focus_distance_m))


@quiet
def depth_from_blur_m(
    blur_radius_um: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike = np.inf,
    branch: Branch = "near",
) -> Floats:
    """Return the depth at which a point has this blur (Eqs. 9-10, for any focus distance).

    `near` is in front of the plane of focus, `far` behind it: 1/d = 1/s +- r / (a v). At infinite
    focus only `near` exists, and it is Eq. 10: d = f a / r. A far blur larger than that of a point
    at infinity belongs to no depth: NaN.

    Raises:
        ValueError: there is no such branch.
    """
    if branch not in get_args(Branch):
        raise ValueError(f"branch {branch!r} is not one of {', '.join(get_args(Branch))}")
    r_mm = floats(blur_radius_um) * 1e-3
    vergence = r_mm / _radius_per_vergence_mm2(focal_length_mm, f_number, focus_distance_m)
    inverse_d_mm = _inverse_mm(focus_distance_m) + (vergence if branch == "near" else -vergence)
    return np.where((inverse_d_mm >= 0) & (r_mm >= 0), 1e-3 / inverse_d_mm, np.nan)


@quiet
def hyperfocal_distance_m(
    focal_length_mm: ArrayLike, f_number: ArrayLike, circle_of_confusion_um: ArrayLike
) -> Floats:
    """Return H = f^2 / (N c) + f: focused there, infinity is just sharp (blur_radius_um = c / 2)."""
    f_mm, c_mm = positive(focal_length_mm), floats(circle_of_confusion_um) * 1e-3
    return np.asarray((f_mm**2 / (positive(f_number) * c_mm) + f_mm) * 1e-3)


@quiet
def depth_of_field_m(
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    focus_distance_m: ArrayLike,
    circle_of_confusion_um: ArrayLike,
) -> tuple[Floats, Floats]:
    """Return the nearest and farthest depth blurred by no more than a circle; far may be infinite."""
    radius_um = floats(circle_of_confusion_um) / 2
    near_m = depth_from_blur_m(radius_um, focal_length_mm, f_number, focus_distance_m, "near")
    far_m = depth_from_blur_m(radius_um, focal_length_mm, f_number, focus_distance_m, "far")
    return near_m, np.where(np.isnan(far_m) & ~np.isnan(near_m), np.inf, far_m)


def _radius_per_vergence_mm2(
    focal_length_mm: ArrayLike, f_number: ArrayLike, focus_distance_m: ArrayLike
) -> Floats:
    """Return a v, the blur radius per unit of 1/s - 1/d."""
    a_mm = aperture_radius_mm(focal_length_mm, f_number)
    return np.asarray(a_mm * image_distance_mm(focus_distance_m, focal_length_mm))


def _inverse_mm(focus_distance_m: ArrayLike) -> Floats:
    """Return 1 / s in 1/mm: zero for an infinite or unknown focus distance.

    1/f - 1/v is the same, but cancels at far focus.
    """
    s_m = floats(focus_distance_m)
    return np.where(np.isnan(s_m), 0.0, 1e-3 / s_m)
