"""PNG pictures with samples of 16 bits, as bare samples (W3C PNG, 11.2.1: the bit depth in IHDR)."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.core.errors import UndecodableImage
from pipeline.core.records import RawLayout
from pipeline.images.header import hidden_cost, image_size

_PNG = b"\x89PNG\r\n\x1a\n"
_DEPTH_AT = 24
_ENCODINGS = {1: "mono16", 3: "bgr16", 4: "bgra16"}  # by channels, as OpenCV returns them


def is_wide_png(image: bytes) -> bool:
    """Return whether a picture is a PNG with samples of 16 bits."""
    return image[:8] == _PNG and image[_DEPTH_AT : _DEPTH_AT + 1] == b"\x10"


def wide_png(image: bytes, max_pixels: int) -> tuple[bytes, RawLayout]:
    """Return the samples of a PNG of 16 bits, and their layout.

    Raises:
        UndecodableImage: its data are damaged, or it has more than `max_pixels`.
    """
    width_px, height_px = image_size(image) or (0, 0)
    if width_px * height_px > max_pixels or hidden_cost(image, 1) is not None:
        raise UndecodableImage(f"{width_px} x {height_px} pixels, the limit is {max_pixels:,}")
    try:
        wide = cv2.imdecode(np.frombuffer(image, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise UndecodableImage(f"OpenCV: {error.err or error}") from error
    if wide is None or wide.dtype != np.uint16:
        raise UndecodableImage("the picture's data are damaged")
    channels = 1 if wide.ndim == 2 else wide.shape[2]
    samples = np.ascontiguousarray(wide, dtype="<u2")
    return samples.tobytes(), RawLayout(_ENCODINGS[channels], wide.shape[1], wide.shape[0])
