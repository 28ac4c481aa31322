"""One number of any channel, by its path, in a unit: how a camera file names exposure values.

"/diag.fnum"                         the field `fnum` of the messages on /diag
"/camera/state.lens.focus cm"        nested, in centimetres
"/diagnostics.status[0].values[2].value us"
"/diagnostics.status[0].values.exposure_time us"                     by its key
/diagnostics.status["cam: driver"].values["Exposure (us)"] us        by names with blanks
"/meta.data.lens.fnumber"            in JSON that the text `data` holds
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.core.arrays import NAN
from pipeline.core.config import CameraConfig
from pipeline.core.errors import UsageError
from pipeline.core.exposure import FIELDS
from pipeline.messages.tree import Tree, as_number

_SPEC = re.compile(r'^(?P<path>(?:"[^"]*"|\S)+?)(?:\s+(?P<unit>\S+))?$')
_STEP = re.compile(r'\.?([A-Za-z_]\w*)|\[(\d{1,6})\]|\["([^"]*)"\]')
# Names under which lists of pairs hold their keys: diagnostic_msgs/KeyValue, DiagnosticStatus, others.
_KEYS = ("key", "name", "id")
_MOST_PAIRS = 10_000


@dataclass(frozen=True, slots=True)
class NamedNumber:
    """Place of a camera's exposure value in its messages, and its unit."""

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
        _parsed(camera.name, name, getattr(camera.exposure, name))
        for camera in cameras
        for name in FIELDS
        if getattr(camera.exposure, name)
    ]


def in_unit(field: str, value: float, unit: str) -> float:
    """Return a value given in a unit in that of the field's name."""
    return FIELDS[field].units[unit](value)


def _parsed(camera: str, field: str, spec: str) -> NamedNumber:
    found = _SPEC.match(spec.strip())
    if found is None or "." not in found["path"]:
        raise UsageError(
            f"exposure.{field} = {spec!r} of camera {camera!r} names no field",
            remedy='Write the topic, a dot and the field, and a unit: "/diag.exposure us"',
        )
    known = list(FIELDS[field].units)
    unit = (found["unit"] or known[0]).lower()
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
        if isinstance(value, str):
            value = _json_in(value)
        if step[2]:
            indexed = isinstance(value, list | tuple | bytes | np.ndarray)
            index = int(step[2])
            value = value[index] if indexed and index < len(value) else None
        else:
            value = _named(value, step[1] or step[3])
    return as_number(value)


def _named(value: Any, name: str) -> Any:
    """Return the field of a message, or the value of a key in a list of pairs."""
    if isinstance(value, Mapping):
        return value.get(name)
    if not isinstance(value, list | tuple):
        return None
    for pair in value[:_MOST_PAIRS]:
        if isinstance(pair, Mapping) and any(pair.get(key) == name for key in _KEYS):
            return pair.get("value", pair)
    return None


def _json_in(text: str) -> Any:
    """Return what a text holds as JSON; None where it is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None
