"""Exposure: the light in the scene, from the settings of a camera (Eq. 15).

A setting that is not positive is none: NaN.
"""

from __future__ import annotations

import numpy as np

from pipeline.optics.arrays import ArrayLike, Floats, floats, positive, quiet

# Luminance of linear Rec. 709 primaries. The paper prints 0.2162 for the first, an erratum.
LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)

# Reflected-light meter constant, cd s / (m^2 ISO); ISO 2720 allows 10.6 to 13.4.
METER_CONSTANT = 12.5
METER_CONSTANT_BOUNDS = (10.6, 13.4)


@quiet
def srgb_to_linear(value: ArrayLike) -> Floats:
    """Return linear light for an sRGB value, both 0..1 (IEC 61966-2-1)."""
    x = floats(value)
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0.0) + 0.055) / 1.055) ** 2.4)


@quiet
def linear_to_srgb(value: ArrayLike) -> Floats:
    """Return the sRGB value of linear light, both 0..1 (IEC 61966-2-1)."""
    x = floats(value)
    return np.where(x <= 0.0031308, x * 12.92, 1.055 * np.maximum(x, 0.0) ** (1 / 2.4) - 0.055)


@quiet
def relative_luminance(red: ArrayLike, green: ArrayLike, blue: ArrayLike) -> Floats:
    """Return I_s = 0.2126 R + 0.7152 G + 0.0722 B of linear values (Eq. 15, corrected)."""
    by_red, by_green, by_blue = LUMINANCE_WEIGHTS
    return np.asarray(by_red * floats(red) + by_green * floats(green) + by_blue * floats(blue))


@quiet
def exposure_value(f_number: ArrayLike, exposure_time_s: ArrayLike) -> Floats:
    """Return EV = log2(N^2 / t) (ISO 2720)."""
    return np.asarray(np.log2(positive(f_number) ** 2 / positive(exposure_time_s)))


@quiet
def exposure_value_100(
    f_number: ArrayLike, exposure_time_s: ArrayLike, iso_speed: ArrayLike
) -> Floats:
    """Return EV100 = EV - log2(ISO / 100), the exposure value that ISO 100 would need."""
    gain = np.log2(positive(iso_speed) / 100.0)
    return np.asarray(exposure_value(f_number, exposure_time_s) - gain)


@quiet
def scene_luminance_cd_m2(
    f_number: ArrayLike,
    exposure_time_s: ArrayLike,
    iso_speed: ArrayLike,
    meter_constant: float = METER_CONSTANT,
) -> Floats:
    """Return L = K N^2 / (t ISO), the luminance that these settings render mid-grey (ISO 2720).

    Raises:
        ValueError: the meter constant is outside what ISO 2720 allows.
    """
    _check_meter_constant(meter_constant)
    light = positive(exposure_time_s) * positive(iso_speed)
    return np.asarray(meter_constant * positive(f_number) ** 2 / light)


@quiet
def expected_pixel_value(
    f_number: ArrayLike,
    exposure_time_s: ArrayLike,
    iso_speed: ArrayLike,
    luminance: ArrayLike,
    meter_constant: float = METER_CONSTANT,
) -> Floats:
    """Return N_d = K_c t ISO / N^2 * I_s, in proportion to a pixel's linear value (Eq. 15).

    Raises:
        ValueError: the meter constant is outside what ISO 2720 allows.
    """
    _check_meter_constant(meter_constant)
    light = positive(exposure_time_s) * positive(iso_speed)
    return np.asarray(meter_constant * light / positive(f_number) ** 2 * floats(luminance))


def _check_meter_constant(meter_constant: float) -> None:
    low, high = METER_CONSTANT_BOUNDS
    if not low <= meter_constant <= high:
        raise ValueError(f"the meter constant {meter_constant:g} is outside {low}-{high}")
