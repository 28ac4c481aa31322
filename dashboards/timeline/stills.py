"""Pictures on their way to the timeline: passed through as they are, or shrunk to previews."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import rerun as rr

from dashboards.timeline.columns import CameraRows, Frames
from dashboards.timeline.names import path
from dashboards.timeline.stream import clocks
from pipeline.core.errors import UndecodableImage
from pipeline.images.header import image_size

# Pictures are sent in batches: large enough for columns to pay, small enough for the cache: at 2 MB a
# frame took two thirds of the time that it took at 8 MB.
BATCH_BYTES = 2 * 1024**2
# What a picture is, by its first bytes; what the recording calls it may be anything.
SIGNATURES = ((b"\xff\xd8\xff", "image/jpeg"), (b"\x89PNG", "image/png"), (b"RIFF", "image/webp"))
_SIGNATURE_BYTES = 4
_BLOBS = pa.list_(pa.field("item", pa.uint8(), nullable=False))  # as Rerun has them
PREVIEW_QUALITY = 75
_REDUCED = (
    (8, cv2.IMREAD_REDUCED_COLOR_8),
    (4, cv2.IMREAD_REDUCED_COLOR_4),
    (2, cv2.IMREAD_REDUCED_COLOR_2),
)


class StillEncoded(NamedTuple):
    """One picture on its way through; its bytes may be good only until the next one comes."""

    camera: str
    frame_index: int
    image: bytes | memoryview


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
    room = BATCH_BYTES // max(len(cameras), 1)  # all that wait are within the size of a batch
    waiting: dict[str, _Batch] = {}
    for camera, frame_index, image in images:
        rows = cameras.get(camera)
        row = None if rows is None else _row_of(rows.frames, frame_index)
        if rows is None or row is None:
            continue
        if frame_index in lost[camera]:
            image = b""
        elif preview_px is not None:
            image = preview(bytes(image), preview_px)
        batch = waiting.get(camera)
        if batch is not None and len(image) > batch.room:
            batch.send(stream, rows)
            batch = None
        if batch is None:
            batch = waiting[camera] = _Batch(max(room, len(image)))
        batch.add(row, image)
    for camera, batch in waiting.items():
        batch.send(stream, cameras[camera])


class _Batch:
    """Pictures of one camera, each copied once: to where Arrow and Rerun take it."""

    def __init__(self, size: int) -> None:
        self._memory = np.empty(size, dtype=np.uint8)
        self._ends = [0]  # of the pictures, in the memory
        self._kinds: list[str] = []
        self._row: list[int] = []
        self._shown: list[int] = []  # 0 where a frame has no picture

    @property
    def room(self) -> int:
        """Number of bytes that can still be added."""
        return len(self._memory) - self._ends[-1]

    def add(self, row: int, image: bytes | memoryview) -> None:
        """Add the picture of a frame, or, with no bytes, that there is none."""
        self._row.append(row)
        self._shown.append(1 if image else 0)
        if image:
            start = self._ends[-1]
            self._ends.append(start + len(image))
            self._memory[start : self._ends[-1]] = np.frombuffer(image, dtype=np.uint8)
            self._kinds.append(media_type(bytes(image[:_SIGNATURE_BYTES])))

    def send(self, stream: rr.RecordingStream, rows: CameraRows) -> None:
        """Send what was added."""
        if not self._kinds:
            return
        memory = pa.py_buffer(self._memory[: self._ends[-1]])
        values = pa.Array.from_buffers(pa.uint8(), len(memory), [None, memory])
        ends = pa.array(self._ends, type=pa.int32())
        columns = rr.EncodedImage.columns(
            blob=pa.ListArray.from_arrays(ends, values, type=_BLOBS), media_type=self._kinds
        )
        stream.send_columns(
            path("cameras", rows.name, "camera", "image"),
            clocks(rows.frames, np.array(self._row)),
            columns.partition(np.array(self._shown)),
        )


def _row_of(frames: Frames, frame_index: int) -> int | None:
    """Return the position of a frame, or None if it is not among them."""
    row = int(frames.frame_index.searchsorted(frame_index))
    return row if row < len(frames) and frames.frame_index[row] == frame_index else None


def media_type(image: bytes) -> str:
    """Return what a picture is."""
    return next((kind for start, kind in SIGNATURES if image.startswith(start)), "image/jpeg")


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
