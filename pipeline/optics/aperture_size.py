"""The paper's method, Eq. 16: depth from the aperture, a factor k, and the size on the sensor.

Units. The paper gives f, I_inf, O_s and O_d in cm, but a_R in mm (it prints "cm"). In one unit
throughout, its a_R is therefore ten times the aperture radius, and with the lens focused at
infinity (I_inf = f) Eq. 16 becomes

    depth = f (10 k a_R) / o

which is similar triangles with an object of the width 10 k a_R: a calibrated object size. So k
belongs to the objects that it was fitted on.
"""

from __future__ import annotations

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet
from pipeline.optics.thin_lens import aperture_radius_mm

# Table 8. The paper gives ranges; both ends are entered: 1.8-2, 2.2-2.5, 4-4.5, 8-9.
# (f-number, k); there is no entry for f/5, which Tables 9-10 use.
TABLE_8: tuple[tuple[float, float], ...] = (
    (1.8, 0.45),
    (2.0, 0.45),
    (2.2, 0.5),
    (2.5, 0.5),
    (2.8, 0.66),
    (3.2, 0.76),
    (3.5, 0.85),
    (4.0, 0.95),
    (4.5, 0.95),
    (5.6, 1.12),
    (6.3, 1.33),
    (7.1, 1.43),
    (8.0, 1.818),
    (9.0, 1.818),
    (10.0, 2.0),
    (11.0, 2.2),
    (13.0, 2.7),
    (14.0, 2.9),
    (16.0, 3.2),
)
K_TABLE_8: tuple[Floats, Floats] = (
    np.array([n for n, _ in TABLE_8]),
    np.array([k for _, k in TABLE_8]),
)

# Section 4.1.1: the paper searches k within these.
K_BOUNDS = (0.45, 3.2)

# a_R is in mm where the other lengths are in cm (see above).
MM_PER_CM = 10.0

# An f-number this near an end of a table, relatively, is that end: 1.8 may come as a float32.
_SAME_F_NUMBER = 1e-6


@quiet
def interpolate_k(
    f_number: ArrayLike,
    table_f_number: ArrayLike = K_TABLE_8[0],
    table_k: ArrayLike = K_TABLE_8[1],
    *,
    extrapolate: bool = False,
) -> Floats:
    """Return k for f-numbers, linear in log N; NaN outside the table unless told to extrapolate.

    The table's f-numbers ascend. Extrapolation holds the equivalent object size of the nearest
    entry, so k grows with N as the aperture radius shrinks; continuing the line would make sizes up.
    """
    n, nodes, k = positive(f_number), floats(table_f_number), floats(table_k)
    inside = np.interp(np.log(n), np.log(nodes), k)
    below = n < nodes[0] * (1 - _SAME_F_NUMBER)
    above = n > nodes[-1] * (1 + _SAME_F_NUMBER)
    low, high = (k[0] * n / nodes[0], k[-1] * n / nodes[-1]) if extrapolate else (np.nan, np.nan)
    return np.where(below, low, np.where(above, high, inside))


@quiet
def equivalent_object_size_m(
    k: ArrayLike, focal_length_mm: ArrayLike, f_number: ArrayLike
) -> Floats:
    """Return W = 10 k a_R: the object size that k stands for."""
    return np.asarray(floats(k) * _aperture_in_eq16_mm(focal_length_mm, f_number) * 1e-3)


@quiet
def depth_eq16_m(
    size_on_sensor_mm: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
    k: ArrayLike,
    image_distance_mm: ArrayLike | None = None,
) -> Floats:
    """Return |O_d| = |k f I a / (I a - f (o + a))| with a = 10 a_R (Eq. 16, one unit throughout).

    Without an image distance I the lens is focused at infinity, I = f. The printed sign is
    negative there; depth is its magnitude.
    """
    f_mm, o_mm = floats(focal_length_mm), positive(size_on_sensor_mm)
    i_mm = f_mm if image_distance_mm is None else floats(image_distance_mm)
    a_mm = _aperture_in_eq16_mm(f_mm, f_number)
    # I a - f (o + a), written so that it does not cancel at I = f
    denominator_mm2 = (i_mm - f_mm) * a_mm - f_mm * o_mm
    return np.asarray(np.abs(floats(k) * f_mm * i_mm * a_mm / denominator_mm2) * 1e-3)


@quiet
def implied_k(
    depth_m: ArrayLike,
    size_on_sensor_mm: ArrayLike,
    focal_length_mm: ArrayLike,
    f_number: ArrayLike,
) -> Floats:
    """Return the k with which Eq. 16, focused at infinity, gives a depth: k = d o / (10 f a_R)."""
    f_mm, d_mm = floats(focal_length_mm), floats(depth_m) * 1e3
    size_mm = d_mm * positive(size_on_sensor_mm) / f_mm
    return np.asarray(size_mm / _aperture_in_eq16_mm(f_mm, f_number))


@quiet
def depth_eq16_std_m(
    depth_m: ArrayLike,
    size_on_sensor_mm: ArrayLike,
    size_std_mm: ArrayLike,
    k: ArrayLike = 1.0,
    k_std: ArrayLike = 0.0,
) -> Floats:
    """Return the standard deviation of Eq. 16 at infinite focus, to first order.

    Depth is proportional to k / o, so relative variances add.
    """
    by_size = floats(size_std_mm) / positive(size_on_sensor_mm)
    by_k = floats(k_std) / positive(k)
    return np.asarray(floats(depth_m) * np.hypot(by_size, by_k))


def _aperture_in_eq16_mm(focal_length_mm: ArrayLike, f_number: ArrayLike) -> Floats:
    """Return 10 a_R, the paper's a_R in the unit of its other lengths."""
    return np.asarray(MM_PER_CM * aperture_radius_mm(focal_length_mm, f_number))
