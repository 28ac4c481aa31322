"""Exposure: stadimeter.CameraExposure, and any JSON object with the same names."""

from __future__ import annotations

import math
from collections.abc import Collection

from pipeline.core.exposure import FIELDS, Exposure, check_exposure
from pipeline.mcap_file.writer import timestamp
from pipeline.messages.content import Decoded
from pipeline.messages.tree import Tree, as_number, frame_id_of, time_of
from schemas.stadimeter_pb2 import CameraExposure


def camera_exposure(tree: Tree) -> Decoded:
    """Return the values that are stated and possible."""
    stated = {
        row.name: as_number(tree[row.message_name])
        for row in FIELDS.values()
        if tree.get(row.message_name) is not None
    }
    exposure, refused = check_exposure(stated)
    return Decoded(time_of(tree), frame_id_of(tree), exposure, refused, "invalid_exposure")


def names_exposure(names: Collection[str]) -> bool:
    """Return whether an object with these names is an exposure: a name with its unit is hardly chance."""
    return any(row.message_name in names for row in FIELDS.values())


def exposure_message(exposure: Exposure, time_ns: int, frame_id: str) -> CameraExposure:
    """Return the message of what is known of a frame's exposure: unknown values are left out."""
    message = CameraExposure(timestamp=timestamp(time_ns), frame_id=frame_id)
    for row in FIELDS.values():
        value = getattr(exposure, row.name)
        if not math.isnan(value):
            setattr(message, row.message_name, int(value) if row.whole else value)
    return message
