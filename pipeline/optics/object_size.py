"""Depth from a known size, size from a known depth, and how their errors carry over.

o size on the sensor, W true size, d depth, f focal length, v image distance, m magnification.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.optics.thin_lens import magnification

Floats = npt.NDArray[np.float64]
ArrayLike = npt.ArrayLike

# Eq. 17 with Table 13: depth_cm = 1.221 + 24.910 / o_cm. In metres and millimetres the slope is
# 24.910 cm^2 = 24.910 * 0.01 m * 10 mm. The printed standard error 0.990 of the slope contradicts
# the printed t = 61.928; 24.910 / 61.928 = 0.402.
EQ17_B0_M, EQ17_B1_M_MM = 1.221e-2, 2.4910
EQ17_B0_STD_M, EQ17_B1_STD_M_MM = 1.333e-2, 0.0402


def size_on_sensor_mm(size_px: ArrayLike, pixel_pitch_um: ArrayLike) -> Floats:
    """Return o = pixels * pitch."""
    return np.asarray(np.asarray(size_px, dtype=np.float64) * np.asarray(pixel_pitch_um) * 1e-3)


def depth_from_size_m(
    object_size_m: ArrayLike, size_on_sensor_mm: ArrayLike, image_distance_mm: ArrayLike
) -> Floats:
    """Return d = v W / o (similar triangles through the centre of the lens, Eq. 11)."""
    o_mm = np.asarray(size_on_sensor_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        d_m = np.asarray(object_size_m, float) * np.asarray(image_distance_mm, float) / o_mm
    return np.where(o_mm > 0, d_m, np.nan)


def depth_from_size_focused_m(
    object_size_m: ArrayLike, size_on_sensor_mm: ArrayLike, focal_length_mm: ArrayLike
) -> Floats:
    """Return d = f (1 + W / o), for a lens focused on the object (m = f / (d - f))."""
    o_mm = np.asarray(size_on_sensor_mm, dtype=np.float64)
    f_m = np.asarray(focal_length_mm, dtype=np.float64) * 1e-3
    with np.errstate(invalid="ignore", divide="ignore"):
        d_m = f_m * (1.0 + np.asarray(object_size_m, dtype=np.float64) * 1e3 / o_mm)
    return np.where(o_mm > 0, d_m, np.nan)


def depth_from_size_std_m(
    depth_m: ArrayLike,
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    object_size_m: ArrayLike = 1.0,
    object_size_std_m: ArrayLike = 0.0,
) -> Floats:
    """Return the standard deviation of d = v W / o to first order: relative variances add."""
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.hypot(
            np.asarray(size_std_mm, float) / np.asarray(size_on_sensor_mm, float),
            np.asarray(object_size_std_m, float) / np.asarray(object_size_m, float),
        )
    return np.asarray(np.asarray(depth_m, dtype=np.float64) * relative)


def depth_inverse_model_m(
    size_on_sensor_mm: ArrayLike,
    b0_m: ArrayLike = EQ17_B0_M,
    b1_m_mm: ArrayLike = EQ17_B1_M_MM,
) -> Floats:
    """Return d = b0 + b1 / o (Eq. 17); the defaults are the paper's."""
    o_mm = np.asarray(size_on_sensor_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        d_m = np.asarray(b0_m, dtype=np.float64) + np.asarray(b1_m_mm, dtype=np.float64) / o_mm
    return np.where(o_mm > 0, d_m, np.nan)


def depth_inverse_model_std_m(
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    b1_m_mm: ArrayLike = EQ17_B1_M_MM,
    residual_std_m: ArrayLike = 0.0,
) -> Floats:
    """Return the standard deviation of Eq. 17: |b1| / o^2 times that of o, and the fit's residual."""
    o_mm = np.asarray(size_on_sensor_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_size_m = np.abs(np.asarray(b1_m_mm, float)) / o_mm**2 * np.asarray(size_std_mm, float)
    return np.asarray(np.hypot(by_size_m, np.asarray(residual_std_m, dtype=np.float64)))


def height_eq14_m(
    size_on_sensor_mm: ArrayLike, depth_m: ArrayLike, focal_length_mm: ArrayLike
) -> Floats:
    """Return o d / f (Eq. 14), which takes m = f / d and so is too large by d / (d - f)."""
    o_mm = np.asarray(size_on_sensor_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(o_mm * np.asarray(depth_m, float) / np.asarray(focal_length_mm, float))


def height_exact_m(
    size_on_sensor_mm: ArrayLike, depth_m: ArrayLike, focal_length_mm: ArrayLike
) -> Floats:
    """Return o / m with m = f / (d - f), for a lens focused on the object (Eq. 11, exact)."""
    o_m = np.asarray(size_on_sensor_mm, dtype=np.float64) * 1e-3
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(o_m / magnification(depth_m, focal_length_mm))


def height_exact_std_m(
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    depth_m: ArrayLike,
    depth_std_m: ArrayLike,
    focal_length_mm: ArrayLike,
) -> Floats:
    """Return the standard deviation of `height_exact_m` to first order, errors independent."""
    o_mm = np.asarray(size_on_sensor_mm, dtype=np.float64)
    f_mm = np.asarray(focal_length_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        by_size_m = np.asarray(size_std_mm, float) * 1e-3 / magnification(depth_m, f_mm)
        by_depth_m = o_mm / f_mm * np.asarray(depth_std_m, dtype=np.float64)
    return np.asarray(np.hypot(by_size_m, by_depth_m))
