"""Exposure fields: one table of their names, units and bounds, and the values of one frame.

A new field is one row of `Exposure`, the field in schemas/stadimeter.proto and, if it is stored, its
column in schemas/sql/tables.sql (`FRAMES` in core/tables.py follows). Everything else reads `FIELDS`:
messages, named fields of camera files, EXIF, photos that are imported, rows of `frames`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from pipeline.core.arrays import NAN

Conversion = Callable[[float], float]


@dataclass(frozen=True, slots=True)
class ExposureField:
    """One value that a recording may state of a frame's lens and exposure.

    The bounds are the lowest and highest value that a real camera can have, both included. They are
    wide on purpose: they refuse the impossible, not the unusual.
    """

    name: str  # in Python, in camera files and in tables; it ends with the unit
    message_name: str  # in stadimeter.CameraExposure
    units: Mapping[str, Conversion]  # by name: into the field's own unit, which comes first
    low: float
    high: float
    exif: str  # the tag that states it, by its name in `pipeline.images.exif`; empty: none does
    zero_is_unknown: bool  # EXIF writes 0 for "unknown"; elsewhere a zero is a claim
    whole: bool  # the message holds an integer
    stored: bool  # it is a column of the table `frames`

    @property
    def bounds(self) -> tuple[float, float]:
        """The lowest and the highest possible value."""
        return self.low, self.high


def _times(factor: float) -> Conversion:
    return lambda value: value * factor


def _reciprocal(value: float) -> float:
    return math.inf if value == 0 else 1 / value


def _decibels_of_amplitude(value: float) -> float:
    return 20 * math.log10(value) if value > 0 else NAN


_PLAIN = {"1": _times(1.0)}
_EV = {"ev": _times(1.0)}
_PX = {"px": _times(1.0)}
_TIME = {
    **{"s": _times(1.0), "ms": _times(1e-3), "us": _times(1e-6), "ns": _times(1e-9)},
    "1/s": _reciprocal,
}
_MM = {
    **{"mm": _times(1.0), "cm": _times(10.0), "m": _times(1e3), "um": _times(1e-3)},
    "in": _times(25.4),
}
_M = {
    **{"m": _times(1.0), "mm": _times(1e-3), "cm": _times(1e-2)},
    **{"ft": _times(0.3048), "in": _times(0.0254)},
    "dpt": _reciprocal,  # a dioptre is the reciprocal of a metre; 0 dioptres are infinity
}
_UM = {"um": _times(1.0), "mm": _times(1e3), "nm": _times(1e-3)}
_DB = {"db": _times(1.0), "x": _decibels_of_amplitude}


def _row(
    units: Mapping[str, Conversion],
    low: float,
    high: float,
    *,
    message_name: str = "",
    exif: str = "",
    zero_is_unknown: bool = False,
    whole: bool = False,
    stored: bool = True,
) -> Any:
    """Return a row of the table: a dataclass field, unknown by default, with what is known of it."""
    facts = {
        **{"message_name": message_name, "units": units, "low": low, "high": high, "exif": exif},
        **{"zero_is_unknown": zero_is_unknown, "whole": whole, "stored": stored},
    }
    return field(default=NAN, metadata=facts)


@dataclass(frozen=True, slots=True)
class Exposure:
    """Lens and exposure settings of one frame, in the units of their names; NaN is unknown."""

    exposure_time_s: float = _row(_TIME, 1e-7, 86_400.0, exif="exposure_time")
    # A lens in air cannot be faster than f/0.5; microscopes reach f/0.35.
    f_number: float = _row(_PLAIN, 0.3, 512.0, exif="f_number")
    iso_speed: float = _row(
        _PLAIN, 0.1, 1e8, message_name="photographic_sensitivity", exif="sensitivity"
    )
    exposure_bias_ev: float = _row(_EV, -32.0, 32.0, exif="exposure_bias")
    brightness_ev: float = _row(_EV, -100.0, 100.0, exif="brightness")  # APEX, EXIF 2.32: 99.99
    gain_db: float = _row(_DB, -60.0, 200.0)
    focal_length_mm: float = _row(_MM, 0.1, 20_000.0, exif="focal_length")
    # A lens of this focal length before 35 mm film sees the same angle across the diagonal.
    focal_length_35mm_mm: float = _row(
        _MM, 1.0, 100_000.0, exif="focal_length_35mm", zero_is_unknown=True
    )
    focus_distance_m: float = _row(
        _M, 1e-3, math.inf, exif="subject_distance", zero_is_unknown=True
    )
    digital_zoom_ratio: float = _row(
        _PLAIN, 0.01, 1000.0, exif="digital_zoom_ratio", zero_is_unknown=True, stored=False
    )
    # Of the sensor's own pixels; the columns of `frames` are of the stored picture's.
    pixel_pitch_x_um: float = _row(_UM, 0.1, 1000.0)
    pixel_pitch_y_um: float = _row(_UM, 0.1, 1000.0)
    sensor_width_px: float = _row(_PX, 1.0, 1e6, whole=True, stored=False)
    sensor_height_px: float = _row(_PX, 1.0, 1e6, whole=True, stored=False)


def _fields() -> Mapping[str, ExposureField]:
    rows = {}
    for f in fields(Exposure):
        facts = dict(f.metadata)
        facts["message_name"] = facts["message_name"] or f.name
        rows[f.name] = ExposureField(name=f.name, **facts)
    return rows


FIELDS: Mapping[str, ExposureField] = _fields()

UNKNOWN_EXPOSURE = Exposure()

INFINITE_FOCUS_EXIF = float(0xFFFFFFFF)  # EXIF 2.32 SubjectDistance: infinity


def check_exposure(values: Mapping[str, float]) -> tuple[Exposure, list[str]]:
    """Return the possible values as an `Exposure`, and a sentence for each that was refused.

    Args:
        values: by field of `Exposure`, in its units; an absent field is unknown.
    """
    accepted: dict[str, float] = {}
    refused: list[str] = []
    for name, row in FIELDS.items():
        value = values.get(name, NAN)
        if name not in values or (row.zero_is_unknown and value == 0):
            continue
        if name == "focus_distance_m" and value == INFINITE_FOCUS_EXIF:
            value = math.inf
        if row.low <= value <= row.high:
            accepted[name] = value
        else:  # NaN fails the comparison too
            refused.append(f"{name} {value:g} is impossible (it must be {_range(row)})")
    return Exposure(**accepted), refused


def _range(row: ExposureField) -> str:
    return f"at least {row.low:g}" if math.isinf(row.high) else f"{row.low:g} to {row.high:g}"
