"""Exposure from the EXIF inside JPEG, PNG and WebP pictures.

A small reader of TIFF directories, bounded by the bytes of the block. Values are returned as they
are written; `exposure_of` gives them our names and units.

Sources: EXIF 2.32 (CIPA DC-008-2019); TIFF 6.0, section 2; RFC 9649 (WebP); PNG 1.5, `eXIf`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import NamedTuple

from pipeline.core.arrays import NAN
from pipeline.core.exposure import FIELDS, Exposure, ExposureField, check_exposure

Value = float | str
Tags = Mapping[str, Value]

_MAX_ENTRIES = 512  # of one directory; cameras write about sixty
_HEAD = b"Exif\0\0"
_JPEG_SEARCH_BYTES = 1 << 18  # EXIF stands first in a JPEG and has at most 64 kB
# By tag, in the first directory and in the one that holds the exposure.
_IMAGE_TAGS = {
    0x010F: "make",
    0x0110: "model",
    0x0112: "orientation",
    0x0132: "date_time",
    0x8769: "exif_offset",
}
_EXIF_TAGS = {
    0x829A: "exposure_time",
    0x829D: "f_number",
    0x8827: "sensitivity",
    0x9003: "date_time_original",
    0x9011: "offset_time_original",
    0x9010: "offset_time",
    0x9203: "brightness",
    0x9204: "exposure_bias",
    0x9206: "subject_distance",
    0x920A: "focal_length",
    0x9291: "subsec_time_original",
    0xA002: "pixel_x_dimension",
    0xA003: "pixel_y_dimension",
    0xA20E: "focal_plane_x_resolution",
    0xA20F: "focal_plane_y_resolution",
    0xA210: "focal_plane_resolution_unit",
    0xA404: "digital_zoom_ratio",
    0xA405: "focal_length_35mm",
    0xA433: "lens_make",
    0xA434: "lens_model",
    0xA431: "body_serial_number",
}
# By type: how it is written, and its size.
_TYPES = {
    1: ("B", 1),
    3: ("H", 2),
    4: ("I", 4),
    5: ("II", 8),
    6: ("b", 1),
    8: ("h", 2),
    9: ("i", 4),
    10: ("ii", 8),
    11: ("f", 4),
    12: ("d", 8),
}
_ASCII = 2
# EXIF FocalPlaneResolutionUnit: pixels per inch, per centimetre; two more that cameras write.
_UNIT_UM = {2: 25_400.0, 3: 10_000.0, 4: 1000.0, 5: 1.0}
# The smallest sensor of a camera that writes it is of type 1/4, 3.2 mm wide. Less is what an editor
# leaves that shrank the picture and kept the resolution.
_SMALLEST_SENSOR_UM = 3000.0


class ExifExposure(NamedTuple):
    """An exposure, and a sentence for each value that was refused."""

    exposure: Exposure
    refused: list[str]


def exif_block(image: bytes) -> bytes | None:
    """Return the TIFF block of a picture's EXIF, or None if it has none."""
    if image[:2] == b"\xff\xd8":
        return _in_jpeg(image)
    if image[:8] == b"\x89PNG\r\n\x1a\n":
        return _in_chunks(image, 8, b"eXIf", big_endian=True)
    if image[:4] == b"RIFF" and image[8:12] == b"WEBP":
        block = _in_chunks(image, 12, b"EXIF", big_endian=False)
        return block.removeprefix(_HEAD) if block else None
    return None


def read_tags(block: bytes) -> dict[str, Value]:
    """Return the known tags of a TIFF block; what cannot be read is left out."""
    order = {b"II": "<", b"MM": ">"}.get(block[:2])
    if order is None or len(block) < 8:
        return {}
    tags = _directory(block, order, _number(block, order + "I", 4), _IMAGE_TAGS)
    inner = tags.pop("exif_offset", None)
    if isinstance(inner, float):
        tags |= _directory(block, order, int(inner), _EXIF_TAGS)
    return tags


def exposure_of(tags: Tags, width_px: int, height_px: int) -> ExifExposure:
    """Return the exposure in our names and units; `width_px` and `height_px` are the picture's."""
    stated = {row.name: _stated(tags, row) for row in FIELDS.values() if row.exif}
    stated |= _pitch(tags, width_px, height_px)
    known = {name: value for name, value in stated.items() if not math.isnan(value)}
    exposure, refused = check_exposure(known)
    return ExifExposure(exposure, [f"EXIF: {sentence}" for sentence in refused])


def _stated(tags: Tags, row: ExposureField) -> float:
    """Return the value of a field's tag; NaN if it is unknown, which cameras also write as 0.

    Infinity (a denominator of 0) is a value only where it is a possible one.
    """
    value = tags.get(row.exif, NAN)
    if not isinstance(value, float) or (value == 0 and not row.low <= 0 <= row.high):
        return NAN
    return value if math.isfinite(value) or math.isinf(row.high) else NAN


def _pitch(tags: Tags, width_px: int, height_px: int) -> dict[str, float]:
    """Return the pitch of the sensor's pixels and its size in pixels, by its focal plane resolution."""
    sensor_x_px = _positive(tags, "pixel_x_dimension")
    sensor_y_px = _positive(tags, "pixel_y_dimension")
    known_size = math.isfinite(sensor_x_px + sensor_y_px) and width_px > 0
    # A picture turned after it was taken has its sides exchanged, its EXIF often not.
    if known_size and (sensor_x_px > sensor_y_px) != (width_px > height_px):
        sensor_x_px, sensor_y_px = sensor_y_px, sensor_x_px
    x_res, y_res = (_positive(tags, f"focal_plane_{a}_resolution") for a in "xy")
    unit_um = _UNIT_UM.get(int(_of(tags, "focal_plane_resolution_unit", 2.0)), NAN)
    sides_px = (sensor_x_px, sensor_y_px) if known_size else (width_px, height_px)
    wide_um = unit_um / x_res * max(sides_px)
    if math.isfinite(unit_um / y_res) and wide_um > _SMALLEST_SENSOR_UM:
        return {
            "pixel_pitch_x_um": unit_um / x_res,
            "pixel_pitch_y_um": unit_um / y_res,
            "sensor_width_px": sensor_x_px,
            "sensor_height_px": sensor_y_px,
        }
    return {}


def _of(tags: Tags, name: str, default: float = NAN) -> float:
    value = tags.get(name, default)
    return value if isinstance(value, float) and math.isfinite(value) else default


def _positive(tags: Tags, name: str) -> float:
    """Return a value of a tag in which cameras write 0 for unknown."""
    value = _of(tags, name)
    return value if value != 0 else NAN


def _directory(block: bytes, order: str, offset: int, names: Mapping[int, str]) -> dict[str, Value]:
    tags: dict[str, Value] = {}
    if not 8 <= offset <= len(block) - 2:
        return tags
    count = min(int(_number(block, order + "H", offset)), _MAX_ENTRIES)
    for at in range(offset + 2, min(offset + 2 + 12 * count, len(block) - 11), 12):
        tag, kind, length = struct.unpack_from(order + "HHI", block, at)
        value = _value(block, order, kind, length, at + 8) if tag in names else None
        if names.get(tag) == "brightness" and _unknown_rational(block, order, at + 8):
            continue
        if value is not None:
            tags.setdefault(names[tag], value)
    return tags


def _value(block: bytes, order: str, kind: int, length: int, at: int) -> Value | None:
    if kind == _ASCII:
        start = at if length <= 4 else _number(block, order + "I", at)
        raw = block[start : start + min(length, 256)]
        return raw.partition(b"\0")[0].decode("utf-8", "replace").strip()
    if kind not in _TYPES or length < 1:
        return None
    code, size = _TYPES[kind]
    start = at if size * length <= 4 else _number(block, order + "I", at)
    if not 0 <= start <= len(block) - size:
        return None
    numbers = struct.unpack_from(order + code, block, start)
    if len(numbers) == 1:
        return float(numbers[0])
    top, bottom = numbers
    if bottom == 0:  # infinite, or unknown where the top is 0 too
        return math.inf if top > 0 else None
    if top == 0xFFFFFFFF:  # SubjectDistance: infinity
        return float(top)
    return top / bottom


def _unknown_rational(block: bytes, order: str, at: int) -> bool:
    """Return whether the numerator is 0xFFFFFFFF: an unknown BrightnessValue (EXIF 2.32)."""
    start = int(_number(block, order + "I", at))
    return start <= len(block) - 8 and _number(block, order + "I", start) == 0xFFFFFFFF


def _number(block: bytes, code: str, at: int) -> int:
    return int(struct.unpack_from(code, block, at)[0])


def _in_jpeg(image: bytes) -> bytes | None:
    at, end = 2, min(len(image), _JPEG_SEARCH_BYTES) - 10
    while at < end and image[at] == 0xFF:
        marker, length = image[at + 1], int.from_bytes(image[at + 2 : at + 4], "big")
        if marker == 0xE1 and image[at + 4 : at + 10] == _HEAD:
            return image[at + 10 : at + 2 + length]
        if not 0xE0 <= marker <= 0xEF and marker != 0xFE:  # past what stands before the picture
            return None
        at += 2 + max(length, 2)
    return None


def _in_chunks(image: bytes, at: int, wanted: bytes, *, big_endian: bool) -> bytes | None:
    """Walk the chunks of a PNG (length, name, data, CRC) or a RIFF file (name, length, data)."""
    for _ in range(_MAX_ENTRIES):
        head = image[at : at + 8]
        if len(head) < 8:
            return None
        if big_endian:
            length, name, step = int.from_bytes(head[:4], "big"), head[4:], 12
        else:
            length, name, step = int.from_bytes(head[4:], "little"), head[:4], 8
        if name == wanted:
            return image[at + 8 : at + 8 + length]
        at += step + length + (0 if big_endian else length % 2)
    return None
