"""Pictures of a statement: the best frames of a track, with the marks that the numbers rest on."""

from __future__ import annotations

import base64
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from dashboards.timeline.source import Span, pictures
from pipeline.core.arrays import FloatArray
from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError
from pipeline.images.decode import Image, decode
from pipeline.store.database import Store

Row = Mapping[str, Any]

BEST = 3
MAX_SIDE_PX = 900  # of a picture on the page
WHOLE_SIDE_PX = 1100
THUMBNAIL_PX = 110
MARGIN = 0.35  # of the height of the box, around it
QUALITY = 88
_CAMERA = "FROM cameras WHERE recording_id = ? AND camera = ?"
_FRAMES = """
FROM frames WHERE recording_id = ? AND camera = ? AND list_contains(?, frame_index)
ORDER BY frame_index
"""
_LINE, _EDGE = (0, 158, 115)[::-1], (255, 255, 255)


@dataclass(frozen=True, slots=True)
class Shown:
    """A picture as it is put into the page."""

    frame_index: int
    data: str  # data: URI
    width_px: int
    height_px: int


def best_frames(frames: Sequence[Row], count: int = BEST) -> list[Row]:
    """Return frames spread over the track in which the object is seen whole and large.

    Of equal parts of the track each gives the frame with the tallest box that is not cut, not covered
    and was measured.
    """
    whole = [f for f in frames if f["measured"] and not f["truncated"]] or list(frames)
    parts = np.array_split(np.arange(len(whole)), min(count, len(whole)))
    return [max((whole[i] for i in part.tolist()), key=_worth) for part in parts if len(part)]


def _worth(frame: Row) -> float:
    tall_px = float(frame["y_max_px"] - frame["y_min_px"])
    return tall_px * (1.0 - float(frame["occlusion"]))


def read_pictures(
    store: Store, recording: Row, path: Path, camera: str, indexes: Collection[int], config: Config
) -> dict[int, Image]:
    """Return the pictures of some frames of one camera, by number of the frame.

    Args:
        store: a database that is open.
        recording: the row of the table `recordings`.
        path: its file.
        camera: name of the camera.
        indexes: numbers of the frames.
        config: bounds of what is read.

    Returns:
        As many as could be read.
    """
    key = [recording["recording_id"], camera]
    tables = {
        "frames": store.query(_FRAMES, [*key, sorted(indexes)]),
        "cameras": store.query(_CAMERA, key),
    }
    times = tables["frames"]["log_time_ns"].to_pylist()
    if not times:
        return {}
    span = Span(min(times), max(times))
    found: dict[int, Image] = {}
    with suppress(StadimeterError):  # those before the damage are shown
        for still in pictures(path, recording, tables, config, span):
            picture = decode(
                bytes(still.image),
                max_pixels=config.limits.image_pixels,
                max_scans=config.limits.image_scans,
                full_resolution=True,
            )
            found[still.frame_index] = picture.bgr
    return found


def crop(picture: Image, frame: Row) -> Shown:
    """Return the object of a frame, enlarged, with the ends of its box."""
    drawn, ends = _cut(picture, _box(frame), MARGIN, MAX_SIDE_PX, 6.0)
    return encoded(_with_ends(drawn, ends), frame["frame_index"])


def thumbnail(picture: Image, frame: Row) -> str:
    """Return the object of a frame as a small picture, a data: URI."""
    drawn, _ = _cut(picture, _box(frame), 0.1, THUMBNAIL_PX, 3.0)
    return encoded(drawn, frame["frame_index"]).data


def _box(frame: Row) -> FloatArray:
    return np.array([frame[f"{s}_px"] for s in ("x_min", "y_min", "x_max", "y_max")], dtype=float)


def _cut(
    picture: Image, box: FloatArray, margin: float, longest_px: int, most: float
) -> tuple[Image, FloatArray]:
    """Return what is in and around a box, resized, and the box in it; the whole picture if it is outside.

    Args:
        picture: the whole one.
        box: in its pixels, (4,).
        margin: around the box, as a share of its height.
        longest_px: the longer side comes to this,
        most: but by no larger factor.
    """
    around = margin * (box[3] - box[1])
    low = np.floor(box[:2] - around).astype(int).clip(0)
    high = np.ceil(box[2:] + around).astype(int).clip(1)
    part = picture[low[1] : high[1], low[0] : high[0]]
    if not part.size:
        part, low = picture, np.zeros(2, dtype=int)
    scale = min(longest_px / max(part.shape[:2]), most)
    size = max(round(part.shape[1] * scale), 1), max(round(part.shape[0] * scale), 1)
    way = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
    ends = (box - np.tile(low, 2) + 0.5) * scale - 0.5
    return np.asarray(cv2.resize(part, size, interpolation=way)), ends


def whole(picture: Image, frame: Row) -> Shown:
    """Return a whole picture with the box of the object."""
    scale = min(WHOLE_SIDE_PX / max(picture.shape[:2]), 1.0)
    size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
    drawn = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    x0, y0, x1, y1 = ((_box(frame) + 0.5) * scale - 0.5).round().astype(int).tolist()
    for colour, width in ((_EDGE, 4), (_LINE, 2)):
        cv2.rectangle(drawn, (x0, y0), (x1, y1), colour, width, cv2.LINE_AA)
    return encoded(drawn, frame["frame_index"])


def _with_ends(drawn: Image, ends: FloatArray) -> Image:
    x0, y0, x1, y1 = ends.round().astype(int).tolist()
    reach = max((x1 - x0) // 3, 12)
    for y in (y0, y1):
        for colour, width in ((_EDGE, 5), (_LINE, 2)):
            cv2.line(drawn, (x0 - reach, y), (x1 + reach, y), colour, width, cv2.LINE_AA)
    middle = (x0 + x1) // 2
    for colour, width in ((_EDGE, 3), (_LINE, 1)):
        cv2.line(drawn, (middle, y0), (middle, y1), colour, width, cv2.LINE_AA)
    return drawn


def encoded(picture: Image, frame_index: int) -> Shown:
    """Return a picture for a page, as it is.

    Raises:
        StadimeterError: it cannot be encoded.
    """
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise StadimeterError("a picture of the page cannot be encoded")
    text = base64.b64encode(data.tobytes()).decode("ascii")
    return Shown(frame_index, f"data:image/jpeg;base64,{text}", picture.shape[1], picture.shape[0])
