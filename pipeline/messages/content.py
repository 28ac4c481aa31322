"""Kinds of messages, and the record of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

from pipeline.core.exposure import Exposure
from pipeline.core.records import Boxes, LensClaim, RawLayout, TrueObject
from pipeline.messages.tree import Tree


class Kind(StrEnum):
    """Kind of content of a channel."""

    IMAGE = "image"
    VIDEO = "video"
    CALIBRATION = "calibration"
    EXPOSURE = "exposure"
    TRUTH = "ground truth"
    DETECTIONS = "detections"
    TRANSFORMS = "transforms"
    LABELS = "class names"


@dataclass(frozen=True, slots=True)
class EncodedImage:
    """A picture, still encoded; bare pixels where it has a layout."""

    format: str
    data: bytes
    layout: RawLayout | None = None


@dataclass(frozen=True, slots=True)
class VideoPacket:
    """Bytes of one frame of a video stream."""

    codec: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Transform:
    """Position of the frame `child` in the frame `parent`."""

    parent: str
    child: str
    translation_m: tuple[float, float, float]
    rotation_xyzw: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ClassLabels:
    """Names of a detector's classes, by the number that stands for them in its boxes."""

    name_of: dict[str, str]


Payload = (
    EncodedImage
    | VideoPacket
    | LensClaim
    | Exposure
    | tuple[TrueObject, ...]
    | Boxes
    | tuple[Transform, ...]
    | ClassLabels
)


@dataclass(frozen=True, slots=True)
class Decoded:
    """A message's content.

    `capture_time_ns` is None where the message states no time; `payload` is None where it holds
    nothing of use. `refused` has a sentence for each value that was not taken, under `code`.
    """

    capture_time_ns: int | None
    frame_id: str
    payload: Payload | None
    refused: list[str] = field(default_factory=list)
    code: str = "invalid_value"


Family = Callable[[Tree], Decoded]
