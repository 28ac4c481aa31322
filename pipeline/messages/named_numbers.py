"""One number of any channel, by its path, in a unit: how a camera file names exposure values.

"/diag.fnum"                         the field `fnum` of the messages on /diag
"/camera/state.lens.focus cm"        nested, in centimetres
"/diagnostics.status[0].values[2].value us"
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from pipeline.core.arrays import NAN
from pipeline.core.config import CameraConfig, ExposureFields
from pipeline.core.errors import UsageError
from pipeline.messages.tree import Tree, as_number

_SPEC = re.compile(r"^(?P<path>\S+?)(?:\s+(?P<unit>\S+))?$")
_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d{1,6})\]")

# Units by quantity: what a value is multiplied with to be in the unit of the field's name.
_TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_MM = {"mm": 1.0, "cm": 10.0, "m": 1e3, "um": 1e-3, "in": 25.4}
_M = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "ft": 0.3048, "in": 0.0254}
_UM = {"um": 1.0, "mm": 1e3, "nm": 1e-3}
_PLAIN = {"1": 1.0}
UNITS: Mapping[str, Mapping[str, float]] = {
    "exposure_time_s": _TIME,
    "f_number": _PLAIN,
    "iso_speed": _PLAIN,
    "exposure_bias_ev": {"ev": 1.0},
    "focal_length_mm": _MM,
    "focus_distance_m": _M,
    "gain_db": {"db": 1.0},
    "digital_zoom_ratio": _PLAIN,
    "pixel_pitch_x_um": _UM,
    "pixel_pitch_y_um": _UM,
    "sensor_width_px": {"px": 1.0},
    "sensor_height_px": {"px": 1.0},
}
# Units that are no multiple. A dioptre is the reciprocal of a metre; 0 dioptres are infinity.
_RECIPROCAL = {("exposure_time_s", "1/s"), ("focus_distance_m", "dpt")}
_AMPLIFICATION = ("gain_db", "x")  # of the amplitude


@dataclass(frozen=True, slots=True)
class NamedNumber:
    """Where a camera's exposure value stands, and in which unit."""

    camera: str
    field: str
    spec: str
    path: str
    unit: str

    def topic(self, topics: Collection[str]) -> str | None:
        """Return the topic that the path starts with: the longest, as topics may hold dots."""
        fitting = [t for t in topics if self.path.startswith(t) and self.path[len(t) :][:1] == "."]
        return max(fitting, key=len, default=None)

    def value(self, tree: Tree, topic: str) -> float:
        """Return the value in the unit of the field's name; NaN where it is not there."""
        return in_unit(self.field, _at(tree, self.path[len(topic) :]), self.unit)


def named_numbers(cameras: Sequence[CameraConfig]) -> list[NamedNumber]:
    """Return what the cameras of a camera file name.

    Raises:
        UsageError: a path or a unit means nothing.
    """
    return [
        _parsed(camera.name, f.name, getattr(camera.exposure, f.name))
        for camera in cameras
        for f in fields(ExposureFields)
        if getattr(camera.exposure, f.name)
    ]


def in_unit(field: str, value: float, unit: str) -> float:
    """Return a value given in a unit in that of the field's name."""
    if (field, unit) in _RECIPROCAL:
        return math.inf if value == 0 else 1 / value
    if (field, unit) == _AMPLIFICATION:
        return 20 * math.log10(value) if value > 0 else NAN
    return value * UNITS[field][unit]


def _parsed(camera: str, field: str, spec: str) -> NamedNumber:
    found = _SPEC.match(spec.strip())
    if found is None or "." not in found["path"]:
        raise UsageError(
            f"exposure.{field} = {spec!r} of camera {camera!r} names no field",
            remedy='Write the topic, a dot and the field, and a unit: "/diag.exposure us"',
        )
    unit = (found["unit"] or next(iter(UNITS[field]))).lower()
    known = list(UNITS[field]) + [u for f, u in (*_RECIPROCAL, _AMPLIFICATION) if f == field]
    if unit not in known:
        raise UsageError(
            f"exposure.{field} of camera {camera!r} has the unit {unit!r}, which is not one of "
            f"{', '.join(known)}"
        )
    return NamedNumber(camera, field, spec, found["path"], unit)


def _at(tree: Tree, path: str) -> float:
    value: Any = tree
    position = 0
    while position < len(path):
        step = _STEP.match(path, position)
        if step is None:
            return NAN
        position = step.end()
        if step[1]:
            value = value.get(step[1]) if isinstance(value, Mapping) else None
        else:
            indexed = isinstance(value, list | tuple | bytes | np.ndarray)
            index = int(step[2])
            value = value[index] if indexed and index < len(value) else None
    return as_number(value)
