"""Pictures of a statement: the best frames of a track, with the marks that the numbers rest on."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa

from dashboards.timeline.source import Span, pictures
from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError
from pipeline.images.decode import Image, decode

Row = Mapping[str, Any]

BEST = 3
MAX_SIDE_PX = 900  # of a picture on the page
WHOLE_SIDE_PX = 1100
THUMBNAIL_PX = 110
MARGIN = 0.35  # of the height of the box, around it
QUALITY = 88
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
    path: Path, recording: Row, cameras: pa.Table, frames: pa.Table, config: Config
) -> dict[int, Image]:
    """Return the pictures of some frames of one camera, by number of the frame.

    Args:
        path: the recording.
        recording: its row of the table `recordings`.
        cameras: the camera's row of this table.
        frames: the frames' rows of this one.
        config: bounds of what is read.

    Returns:
        As many as could be read.
    """
    if not frames.num_rows:
        return {}
    times = frames["log_time_ns"].to_pylist()
    span = Span(min(times), max(times))
    found: dict[int, Image] = {}
    try:
        tables = {"frames": frames, "cameras": cameras}
        for still in pictures(path, recording, tables, config, span):
            picture = decode(
                bytes(still.image),
                max_pixels=config.limits.image_pixels,
                max_scans=config.limits.image_scans,
                full_resolution=True,
            )
            found[still.frame_index] = picture.bgr
    except StadimeterError:
        return found
    return found


def crop(picture: Image, frame: Row) -> Shown:
    """Return the object of a frame, enlarged, with the ends of its box."""
    box = np.array([frame[f"{s}_px"] for s in ("x_min", "y_min", "x_max", "y_max")], dtype=float)
    tall = box[3] - box[1]
    low = np.floor(box[:2] - MARGIN * tall).astype(int).clip(0)
    high = np.ceil(box[2:] + MARGIN * tall).astype(int).clip(1)
    part = picture[low[1] : high[1], low[0] : high[0]]
    if not part.size:
        part, low = picture, np.zeros(2, dtype=int)
    scale = min(MAX_SIDE_PX / max(part.shape[:2]), 6.0)
    size = max(round(part.shape[1] * scale), 1), max(round(part.shape[0] * scale), 1)
    way = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
    drawn = cv2.resize(part, size, interpolation=way)
    ends = ((box - np.tile(low, 2) + 0.5) * scale - 0.5).round().astype(int)
    return _shown(_with_ends(drawn, ends), frame["frame_index"])


def thumbnail(picture: Image, frame: Row) -> str:
    """Return the object of a frame as a small picture, a data: URI."""
    box = np.array([frame[f"{s}_px"] for s in ("x_min", "y_min", "x_max", "y_max")], dtype=float)
    around = 0.1 * (box[3] - box[1])
    low = np.floor(box[:2] - around).astype(int).clip(0)
    high = np.ceil(box[2:] + around).astype(int).clip(1)
    part = picture[low[1] : high[1], low[0] : high[0]]
    if not part.size:
        part = picture
    scale = min(THUMBNAIL_PX / max(part.shape[:2]), 3.0)
    size = max(round(part.shape[1] * scale), 1), max(round(part.shape[0] * scale), 1)
    way = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
    return _shown(cv2.resize(part, size, interpolation=way), frame["frame_index"]).data


def whole(picture: Image, frame: Row) -> Shown:
    """Return a whole picture with the box of the object."""
    scale = min(WHOLE_SIDE_PX / max(picture.shape[:2]), 1.0)
    size = round(picture.shape[1] * scale), round(picture.shape[0] * scale)
    drawn = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    box = np.array([frame[f"{s}_px"] for s in ("x_min", "y_min", "x_max", "y_max")], dtype=float)
    x0, y0, x1, y1 = ((box + 0.5) * scale - 0.5).round().astype(int).tolist()
    for colour, width in ((_EDGE, 4), (_LINE, 2)):
        cv2.rectangle(drawn, (x0, y0), (x1, y1), colour, width, cv2.LINE_AA)
    return _shown(drawn, frame["frame_index"])


def encoded(picture: Image, frame_index: int) -> Shown:
    """Return a picture as it is, for marking in it."""
    return _shown(picture, frame_index)


def _with_ends(drawn: Image, ends: np.ndarray) -> Image:
    x0, y0, x1, y1 = ends.tolist()
    reach = max((x1 - x0) // 3, 12)
    for y in (y0, y1):
        for colour, width in ((_EDGE, 5), (_LINE, 2)):
            cv2.line(drawn, (x0 - reach, y), (x1 + reach, y), colour, width, cv2.LINE_AA)
    middle = (x0 + x1) // 2
    for colour, width in ((_EDGE, 3), (_LINE, 1)):
        cv2.line(drawn, (middle, y0), (middle, y1), colour, width, cv2.LINE_AA)
    return drawn


def _shown(picture: Image, frame_index: int) -> Shown:
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise StadimeterError("a picture of the statement cannot be encoded")
    text = base64.b64encode(data.tobytes()).decode("ascii")
    return Shown(frame_index, f"data:image/jpeg;base64,{text}", picture.shape[1], picture.shape[0])


def rows_of(frames: pa.Table, chosen: Iterable[Row]) -> pa.Table:
    """Return the rows of the table `frames` that some frames are."""
    wanted = pa.array([f["frame_index"] for f in chosen], type=pa.int32())
    return frames.filter(pa.compute.is_in(frames["frame_index"], wanted))
