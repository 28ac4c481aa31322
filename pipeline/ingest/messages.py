"""One message -> one record: channels are recognised by their schema, never by their topic's name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from pipeline.ingest.exposure import check_exposure
from pipeline.ingest.mcap_records import ChannelInfo
from pipeline.records import NAN, Boxes, Exposure, FloatArray, Intrinsics, TrueObject
from schemas.stadimeter_pb2 import BoundingBox, CameraExposure, Detections, GroundTruth

# What a drawn box is worth when the detector does not say: half a pixel of rounding to each side,
# and a little more for the judgement of where an object ends.
RECORDED_BOX_STD_PX = 0.5


class Kind(StrEnum):
    """What a channel brings."""

    IMAGE = "image"
    CALIBRATION = "calibration"
    EXPOSURE = "exposure"
    TRUTH = "ground truth"
    DETECTIONS = "detections"


@dataclass(frozen=True, slots=True)
class EncodedImage:
    """A picture, still encoded."""

    format: str
    data: bytes


Payload = EncodedImage | Intrinsics | Exposure | tuple[TrueObject, ...] | Boxes


@dataclass(frozen=True, slots=True)
class Decoded:
    """A message's content; `capture_time_ns` is None where the message states no time."""

    capture_time_ns: int | None
    frame_id: str
    payload: Payload
    refused: list[str]


class UndecodableMessage(ValueError):
    """The bytes are not what the channel's schema says."""


def kind_of(channel: ChannelInfo) -> Kind | None:
    """Return what a channel brings, or None if it is of no use here."""
    if channel.message_encoding != "protobuf":
        return None
    return _KINDS.get(channel.schema_name)


def is_unread_image(channel: ChannelInfo) -> bool:
    """Whether a channel holds pictures or lens data in a form that is not read."""
    if kind_of(channel) is not None:
        return False
    name = channel.schema_name.rsplit(".", 1)[-1].rsplit("/", 1)[-1]
    return name in {"CompressedImage", "RawImage", "CompressedVideo", "Image", "CameraInfo"} or (
        name in {"CameraCalibration", "CameraExposure", "Detections", "GroundTruth"}
    )


def decode(kind: Kind, data: bytes) -> Decoded:
    """Return the content of a message of a channel of this kind.

    Raises:
        UndecodableMessage: the bytes are no such message.
    """
    try:
        return _DECODERS[kind](data)
    except (DecodeError, UnicodeDecodeError) as error:
        raise UndecodableMessage(str(error) or "not a protobuf message") from error


def _image(data: bytes) -> Decoded:
    message = CompressedImage.FromString(data)
    payload = EncodedImage(message.format, message.data)
    return Decoded(_time_ns(message.timestamp), message.frame_id, payload, [])


def _calibration(data: bytes) -> Decoded:
    message = CameraCalibration.FromString(data)
    time_ns, refused = _time_ns(message.timestamp), []
    k = list(message.K)
    if len(k) != 9 or not all(map(math.isfinite, k)) or k[0] <= 0 or k[4] <= 0:
        raise UndecodableMessage("K must be nine finite numbers with positive focal lengths")
    if not all(map(math.isfinite, message.D)):
        refused.append("the distortion coefficients are not finite; taken as no distortion")
    distortion = tuple(message.D) if not refused else ()
    payload = Intrinsics(
        width_px=message.width,
        height_px=message.height,
        fx_px=k[0],
        fy_px=k[4],
        cx_px=k[2],
        cy_px=k[5],
        distortion_model=message.distortion_model if any(distortion) else "",
        distortion=distortion if any(distortion) else (),
    )
    return Decoded(time_ns, message.frame_id, payload, refused)


_EXPOSURE_NAMES = {
    "exposure_time_s": "exposure_time_s",
    "f_number": "f_number",
    "photographic_sensitivity": "iso_speed",
    "exposure_bias_ev": "exposure_bias_ev",
    "focal_length_mm": "focal_length_mm",
    "focus_distance_m": "focus_distance_m",
    "gain_db": "gain_db",
    "digital_zoom_ratio": "digital_zoom_ratio",
    "pixel_pitch_x_um": "pixel_pitch_x_um",
    "pixel_pitch_y_um": "pixel_pitch_y_um",
    "sensor_width_px": "sensor_width_px",
    "sensor_height_px": "sensor_height_px",
}


def _exposure(data: bytes) -> Decoded:
    message = CameraExposure.FromString(data)
    stated = {
        field: float(getattr(message, name))
        for name, field in _EXPOSURE_NAMES.items()
        if message.HasField(name)
    }
    exposure, refused = check_exposure(stated)
    return Decoded(_time_ns(message.timestamp), message.frame_id, exposure, refused)


def _truth(data: bytes) -> Decoded:
    message = GroundTruth.FromString(data)
    objects, refused = [], []
    for row in message.objects:
        values = {
            name: float(getattr(row, name)) if row.HasField(name) else NAN
            for name in ("depth_m", "range_m", "height_m", "width_m", "x_m", "y_m")
        }
        for name in ("depth_m", "range_m", "height_m", "width_m"):
            if row.HasField(name) and not 0 < values[name] < math.inf:
                refused.append(f"true {name} {values[name]:g} is impossible")
                values[name] = NAN
        bbox = _edges(row.box) if row.HasField("box") else (NAN, NAN, NAN, NAN)
        if row.HasField("box") and not _is_box(bbox):
            refused.append(f"true box {bbox} is no box")
            bbox = (NAN, NAN, NAN, NAN)
        objects.append(TrueObject(row.object_id, row.class_name, bbox_xyxy_px=bbox, **values))
    return Decoded(_time_ns(message.timestamp), message.frame_id, tuple(objects), refused)


def _detections(data: bytes) -> Decoded:
    message = Detections.FromString(data)
    kept, refused = [], []
    for row in message.objects:
        if _is_box(_edges(row.box)):
            kept.append(row)
        else:
            refused.append(f"box {_edges(row.box)} is no box")
    scores = [row.score if row.HasField("score") else NAN for row in kept]
    stds = [row.box_std_px if row.HasField("box_std_px") else NAN for row in kept]
    std = np.array(stds, dtype=np.float64)
    std[~((std >= 0) & np.isfinite(std))] = RECORDED_BOX_STD_PX
    payload = Boxes(
        bbox_xyxy_px=_box_array([_edges(row.box) for row in kept]),
        score=np.array(scores, dtype=np.float64),
        class_name=tuple(row.class_name or "unknown" for row in kept),
        std_px=np.repeat(std[:, None], 4, axis=1),
        object_id=tuple(row.object_id if row.HasField("object_id") else None for row in kept),
    )
    return Decoded(_time_ns(message.timestamp), message.frame_id, payload, refused)


def _box_array(rows: list[tuple[float, float, float, float]]) -> FloatArray:
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _edges(box: BoundingBox) -> tuple[float, float, float, float]:
    return (box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px)


def _is_box(edges: tuple[float, float, float, float]) -> bool:
    x_min, y_min, x_max, y_max = edges
    return all(abs(e) < 1e6 for e in edges) and x_min < x_max and y_min < y_max


def _time_ns(timestamp: Timestamp) -> int | None:
    time_ns: int = timestamp.seconds * 1_000_000_000 + timestamp.nanos
    # 0 is protobuf's way of leaving a field out; DuckDB and Arrow hold 63 bits.
    return time_ns if 0 < time_ns < 2**63 else None


_KINDS = {
    "foxglove.CompressedImage": Kind.IMAGE,
    "foxglove.CameraCalibration": Kind.CALIBRATION,
    "stadimeter.CameraExposure": Kind.EXPOSURE,
    "stadimeter.GroundTruth": Kind.TRUTH,
    "stadimeter.Detections": Kind.DETECTIONS,
}

_DECODERS: dict[Kind, Callable[[bytes], Decoded]] = {
    Kind.IMAGE: _image,
    Kind.CALIBRATION: _calibration,
    Kind.EXPOSURE: _exposure,
    Kind.TRUTH: _truth,
    Kind.DETECTIONS: _detections,
}
