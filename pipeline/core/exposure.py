"""Lens and exposure values from a recording, each checked against what is physically possible."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields

from pipeline.core.arrays import NAN


@dataclass(frozen=True, slots=True)
class Exposure:
    """Lens and exposure settings of one frame, in the units of `stadimeter.CameraExposure`."""

    exposure_time_s: float = NAN
    f_number: float = NAN
    iso_speed: float = NAN
    exposure_bias_ev: float = NAN
    focal_length_mm: float = NAN
    focus_distance_m: float = NAN
    gain_db: float = NAN
    digital_zoom_ratio: float = NAN
    pixel_pitch_x_um: float = NAN
    pixel_pitch_y_um: float = NAN
    sensor_width_px: float = NAN
    sensor_height_px: float = NAN


UNKNOWN_EXPOSURE = Exposure()

EXPOSURE_FIELDS = tuple(f.name for f in fields(Exposure))

INFINITE_FOCUS_EXIF = float(0xFFFFFFFF)  # EXIF 2.32 SubjectDistance: infinity

# Lowest and highest value that a real camera can have, both included. They are wide on purpose:
# they refuse the impossible, not the unusual.
BOUNDS: Mapping[str, tuple[float, float]] = {
    "exposure_time_s": (1e-7, 86_400.0),
    "f_number": (0.3, 512.0),  # a lens in air cannot be faster than f/0.5; microscopes reach f/0.35
    "iso_speed": (0.1, 1e8),
    "exposure_bias_ev": (-32.0, 32.0),
    "focal_length_mm": (0.1, 20_000.0),
    "focus_distance_m": (1e-3, math.inf),
    "gain_db": (-60.0, 200.0),
    "digital_zoom_ratio": (0.01, 1000.0),
    "pixel_pitch_x_um": (0.1, 1000.0),
    "pixel_pitch_y_um": (0.1, 1000.0),
    "sensor_width_px": (1.0, 1e6),
    "sensor_height_px": (1.0, 1e6),
}

# EXIF writes 0 for "unknown" in these; elsewhere a zero is a claim, and an absurd one.
ZERO_IS_UNKNOWN = frozenset({"focus_distance_m", "digital_zoom_ratio"})


def check_exposure(values: Mapping[str, float]) -> tuple[Exposure, list[str]]:
    """Return the possible values as an `Exposure`, and a sentence for each that was refused.

    Args:
        values: by field of `Exposure`, in its units; an absent field is unknown.
    """
    accepted: dict[str, float] = {}
    refused: list[str] = []
    for name in EXPOSURE_FIELDS:
        value = values.get(name, NAN)
        if name not in values or (name in ZERO_IS_UNKNOWN and value == 0):
            continue
        if name == "focus_distance_m" and value == INFINITE_FOCUS_EXIF:
            value = math.inf
        low, high = BOUNDS[name]
        if low <= value <= high:
            accepted[name] = value
        else:  # NaN fails the comparison too
            refused.append(f"{name} {value:g} is impossible (it must be {_range(low, high)})")
    return Exposure(**accepted), refused


def _range(low: float, high: float) -> str:
    return f"at least {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"
