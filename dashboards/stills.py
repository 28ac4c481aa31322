"""Pictures on their way to the timeline: passed through as they are, or shrunk to previews."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import cv2
import numpy as np
import pyarrow.compute as pc
import rerun as rr

from dashboards.columns import CameraRows
from dashboards.names import path
from dashboards.stream import clocks
from pipeline.errors import UndecodableImage
from pipeline.picture_header import image_size

# Pictures are sent in batches: large enough for columns to pay, small enough for the cache: at 2 MB a
# frame took two thirds of the time that it took at 8 MB.
BATCH_BYTES = 2 * 1024**2
# What a picture is, by its first bytes; what the recording calls it may be anything.
SIGNATURES = ((b"\xff\xd8\xff", "image/jpeg"), (b"\x89PNG", "image/png"), (b"RIFF", "image/webp"))
PREVIEW_QUALITY = 75
_REDUCED = (
    (8, cv2.IMREAD_REDUCED_COLOR_8),
    (4, cv2.IMREAD_REDUCED_COLOR_4),
    (2, cv2.IMREAD_REDUCED_COLOR_2),
)


class StillEncoded(NamedTuple):
    """One picture on its way through."""

    camera: str
    frame_index: int
    image: bytes


def log_images(
    stream: rr.RecordingStream,
    images: Iterable[StillEncoded],
    cameras: Mapping[str, CameraRows],
    preview_px: int | None,
) -> None:
    """Send the pictures of cameras by their names, in batches.

    A picture that cannot be decoded is left out, so that its frame shows none, not the one before.
    """
    lost = {name: _undecodable(rows) for name, rows in cameras.items()}
    if preview_px is not None:
        images = (
            i._replace(image=preview(i.image, preview_px))
            for i in images
            if i.frame_index not in lost.get(i.camera, ())
        )
    for camera, batch in _batches(images):
        rows = cameras.get(camera)
        if rows is None:
            continue
        index = np.array([p.frame_index for p in batch], dtype=np.int64)
        row = np.searchsorted(rows.frames.frame_index, index)
        row = np.minimum(row, max(len(rows.frames) - 1, 0))
        there = rows.frames.frame_index[row] == index if len(rows.frames) else index < 0
        known = [p for p, t in zip(batch, there, strict=True) if t]
        shown = np.array([bool(p.image) and p.frame_index not in lost[camera] for p in known])
        kept = [p for p, s in zip(known, shown, strict=True) if s]
        if not kept:
            continue
        columns = rr.EncodedImage.columns(
            blob=[p.image for p in kept], media_type=[media_type(p.image) for p in kept]
        )
        stream.send_columns(
            path("cameras", rows.name, "camera", "image"),
            clocks(rows.frames, row[there]),
            columns.partition(shown.astype(np.int64)),
        )


def media_type(image: bytes) -> str:
    """Return what a picture is."""
    return next((kind for start, kind in SIGNATURES if image.startswith(start)), "image/jpeg")


def _batches(images: Iterable[StillEncoded]) -> Iterator[tuple[str, list[StillEncoded]]]:
    """Yield pictures of one camera at a time; all that wait are within the size of a batch."""
    waiting: dict[str, list[StillEncoded]] = {}
    size = 0
    for image in images:
        waiting.setdefault(image.camera, []).append(image)
        size += len(image.image)
        if size >= BATCH_BYTES:
            yield from waiting.items()
            waiting, size = {}, 0
    yield from waiting.items()


def _undecodable(rows: CameraRows) -> frozenset[int]:
    table = rows.frames.table
    lost = table.filter(pc.invert(pc.fill_null(table["decoded"], False)))
    return frozenset(lost["frame_index"].to_pylist())


def preview_scale(width_px: int | None, height_px: int | None, preview_px: int | None) -> float:
    """Return how much a picture is shrunk so that its longer side has `preview_px`."""
    if preview_px is None or not width_px or not height_px:
        return 1.0
    return min(1.0, preview_px / max(width_px, height_px))


def preview(image: bytes, preview_px: int) -> bytes:
    """Return a picture as a JPEG whose longer side is `preview_px`; a smaller one as it is.

    A JPEG is shrunk by whole factors while it is decoded, which costs less than decoding it whole.
    Bytes that are no picture become none.
    """
    try:
        size = image_size(image)
    except UndecodableImage:
        size = None
    if size is None:
        return b""
    scale = preview_scale(*size, preview_px)
    if scale == 1.0:
        return image
    flag = next((flag for factor, flag in _REDUCED if factor * scale <= 1), cv2.IMREAD_COLOR)
    try:
        # As in the recording: what EXIF says of its orientation is not followed.
        large = cv2.imdecode(np.frombuffer(image, np.uint8), flag | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        large = None
    if large is None:
        return b""
    shape = (max(round(size[0] * scale), 1), max(round(size[1] * scale), 1))
    small = cv2.resize(large, shape, interpolation=cv2.INTER_AREA)
    encoded = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, PREVIEW_QUALITY])[1]
    return bytes(encoded)
