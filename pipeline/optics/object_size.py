"""Depth from a known size, size from a known depth, and the propagation of their errors.

o size on the sensor, W true size, d depth, f focal length, v image distance, m magnification.
Standard deviations are to first order, with the errors of what goes in independent.
"""

from __future__ import annotations

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet
from pipeline.optics.thin_lens import magnification

# Eq. 17 with Table 13: depth_cm = 1.221 + 24.910 / o_cm. In metres and millimetres the slope is
# 24.910 cm^2 = 24.910 * 0.01 m * 10 mm. The printed standard error 0.990 of the slope contradicts
# the printed t = 61.928; 24.910 / 61.928 = 0.402.
EQ17_B0_M, EQ17_B1_M_MM = 1.221e-2, 2.4910
EQ17_B0_STD_M, EQ17_B1_STD_M_MM = 1.333e-2, 0.0402


@quiet
def size_on_sensor_mm(size_px: ArrayLike, pixel_pitch_um: ArrayLike) -> Floats:
    """Return o = pixels * pitch (section 3.3)."""
    return np.asarray(floats(size_px) * floats(pixel_pitch_um) * 1e-3)


@quiet
def depth_from_size_m(
    object_size_m: ArrayLike, size_on_sensor_mm: ArrayLike, image_distance_mm: ArrayLike
) -> Floats:
    """Return d = v W / o (similar triangles through the centre of the lens, Eq. 11)."""
    scale = floats(image_distance_mm) / positive(size_on_sensor_mm)
    return np.asarray(floats(object_size_m) * scale)


@quiet
def depth_from_size_std_m(
    depth_m: ArrayLike,
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    object_size_m: ArrayLike = 1.0,
    object_size_std_m: ArrayLike = 0.0,
) -> Floats:
    """Return the standard deviation of d = v W / o: relative variances add."""
    by_sensor = floats(size_std_mm) / positive(size_on_sensor_mm)
    by_object = floats(object_size_std_m) / positive(object_size_m)
    return np.asarray(floats(depth_m) * np.hypot(by_sensor, by_object))


@quiet
def depth_from_size_focused_m(
    object_size_m: ArrayLike, size_on_sensor_mm: ArrayLike, focal_length_mm: ArrayLike
) -> Floats:
    """Return d = f (1 + W / o), for a lens focused on the object (Eq. 11 with m = f / (d - f))."""
    f_m, o_mm = floats(focal_length_mm) * 1e-3, positive(size_on_sensor_mm)
    return np.asarray(f_m * (1.0 + floats(object_size_m) * 1e3 / o_mm))


@quiet
def depth_from_size_focused_std_m(
    depth_m: ArrayLike,
    focal_length_mm: ArrayLike,
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    object_size_m: ArrayLike = 1.0,
    object_size_std_m: ArrayLike = 0.0,
) -> Floats:
    """Return the standard deviation of d = f (1 + W / o): d - f is what scales with W / o."""
    beyond_m = floats(depth_m) - floats(focal_length_mm) * 1e-3
    return depth_from_size_std_m(
        beyond_m, size_on_sensor_mm, size_std_mm, object_size_m, object_size_std_m
    )


@quiet
def depth_inverse_model_m(
    size_on_sensor_mm: ArrayLike,
    b0_m: ArrayLike = EQ17_B0_M,
    b1_m_mm: ArrayLike = EQ17_B1_M_MM,
) -> Floats:
    """Return d = b0 + b1 / o (Eq. 17); the defaults are the paper's."""
    return np.asarray(floats(b0_m) + floats(b1_m_mm) / positive(size_on_sensor_mm))


@quiet
def depth_inverse_model_std_m(
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    b1_m_mm: ArrayLike = EQ17_B1_M_MM,
    residual_std_m: ArrayLike = 0.0,
) -> Floats:
    """Return the standard deviation of Eq. 17: |b1| / o^2 times that of o, and the fit's residual."""
    slope = np.abs(floats(b1_m_mm)) / positive(size_on_sensor_mm) ** 2
    return np.asarray(np.hypot(slope * floats(size_std_mm), floats(residual_std_m)))


@quiet
def height_eq14_m(
    size_on_sensor_mm: ArrayLike, depth_m: ArrayLike, focal_length_mm: ArrayLike
) -> Floats:
    """Return o d / f (Eq. 14), which takes m = f / d and so is too large by d / (d - f)."""
    return np.asarray(floats(size_on_sensor_mm) * floats(depth_m) / positive(focal_length_mm))


@quiet
def height_eq14_std_m(
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    depth_m: ArrayLike,
    depth_std_m: ArrayLike,
    focal_length_mm: ArrayLike,
) -> Floats:
    """Return the standard deviation of `height_eq14_m`."""
    f_mm = positive(focal_length_mm)
    by_size_m = floats(size_std_mm) * floats(depth_m) / f_mm
    by_depth_m = floats(size_on_sensor_mm) / f_mm * floats(depth_std_m)
    return np.asarray(np.hypot(by_size_m, by_depth_m))


@quiet
def height_exact_m(
    size_on_sensor_mm: ArrayLike, depth_m: ArrayLike, focal_length_mm: ArrayLike
) -> Floats:
    """Return o / m with m = f / (d - f), for a lens focused on the object (Eq. 11, exact)."""
    o_m = floats(size_on_sensor_mm) * 1e-3
    return np.asarray(o_m / magnification(depth_m, focal_length_mm))


@quiet
def height_exact_std_m(
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    depth_m: ArrayLike,
    depth_std_m: ArrayLike,
    focal_length_mm: ArrayLike,
) -> Floats:
    """Return the standard deviation of `height_exact_m`."""
    f_mm = positive(focal_length_mm)
    by_size_m = floats(size_std_mm) * 1e-3 / magnification(depth_m, f_mm)
    by_depth_m = floats(size_on_sensor_mm) / f_mm * floats(depth_std_m)
    return np.asarray(np.hypot(by_size_m, by_depth_m))
