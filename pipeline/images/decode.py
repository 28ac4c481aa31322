"""Pixels from a picture's bytes: reduced while decoding, with the brightness measured.

JPEG is decoded at a half, a quarter or an eighth of its size in the transform itself, which costs
little more than reading the entropy code. Motion is found on such a reduced picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.config import MIN_SIDE_PX
from pipeline.core.errors import UndecodableImage
from pipeline.core.records import RawLayout
from pipeline.images.header import hidden_cost, image_size
from pipeline.images.raw import check_encoding, decode_raw
from pipeline.optics.exposure import LUMINANCE_WEIGHTS, srgb_to_linear

Image = npt.NDArray[np.uint8]

_FLAGS = {
    1: cv2.IMREAD_COLOR,
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}
# Brightness is a mean over some 5,000 pixels: its error is far below that of the exposure data.
_SAMPLES_ACROSS = 80
_BLACK, _WHITE = 2, 253


@dataclass(frozen=True, slots=True)
class Picture:
    """A decoded picture, reduced by a whole factor: stored_px = (px + 0.5) * reduction - 0.5."""

    width_px: int  # of the stored picture
    height_px: int
    bgr: Image  # (height / reduction, width / reduction, 3)
    reduction: int
    luminance: float  # mean relative luminance, linear light, 0..1
    clipped_fraction: float
    soft: Image | None = None  # `bgr` as the detector wants it, where it was made while decoding


def decode(
    image: bytes,
    *,
    max_pixels: int,
    max_scans: int = 100,
    full_resolution: bool = False,
    min_side_px: int = MIN_SIDE_PX,
    layout: RawLayout | None = None,
) -> Picture:
    """Decode a JPEG, PNG or WebP picture, or bare pixels where their layout is given.

    Args:
        image: the bytes.
        max_pixels: a picture of more is refused.
        max_scans: and a JPEG of more of these.
        full_resolution: every pixel is wanted.
        min_side_px: otherwise the picture is reduced as long as its shorter side stays that long.
        layout: of bare pixels.

    Raises:
        UndecodableImage: the bytes are no picture, or one larger than `max_pixels`, or one whose
            decoding would cost far more than its size says.
    """
    if layout is not None:
        check_encoding(
            layout
        )  # an encoding that is not read says more than bytes that are not there
    if not image:
        raise UndecodableImage("there are no bytes of it")
    stated = image_size(image) if layout is None else (layout.width_px, layout.height_px)
    if stated is None:
        raise UndecodableImage(f"{len(image)} bytes are no JPEG, PNG or WebP picture")
    width_px, height_px = stated
    if width_px * height_px > max_pixels or min(stated) < 1:
        raise UndecodableImage(f"{width_px} x {height_px} pixels, the limit is {max_pixels:,}")
    reduction = 1 if full_resolution else _reduction(min(stated), min_side_px)
    if layout is None:
        costly = hidden_cost(image, max_scans)
        if costly is not None:
            raise UndecodableImage(costly)
        bgr = _decompress(image, reduction)
    else:
        bgr = decode_raw(image, layout, reduction)
    luminance, clipped = _brightness(bgr)
    return Picture(width_px, height_px, bgr, reduction, luminance, clipped)


def _decompress(image: bytes, reduction: int) -> Image:
    try:
        flag = _FLAGS[reduction] | cv2.IMREAD_IGNORE_ORIENTATION
        bgr = cv2.imdecode(np.frombuffer(image, dtype=np.uint8), flag)
    except cv2.error as error:
        raise UndecodableImage(f"OpenCV: {error.err or error}") from error
    if bgr is None:
        raise UndecodableImage("the picture's data are damaged")
    return np.asarray(bgr, dtype=np.uint8)


def _reduction(side_px: int, min_side_px: int) -> int:
    return next((r for r in (8, 4, 2) if side_px // r >= min_side_px), 1)


@cache
def luminance_tables() -> npt.NDArray[np.float64]:
    """Return linear light times luminance weight by sRGB value, (256, 3) in the order B, G, R."""
    linear = srgb_to_linear(np.arange(256) / 255.0)
    return np.stack([linear * w for w in reversed(LUMINANCE_WEIGHTS)], axis=1)


def relative_luminance_of(bgr: Image) -> npt.NDArray[np.float64]:
    """Return the relative luminance, linear light, of pixels (..., 3) (Eq. 15)."""
    light = cv2.LUT(bgr.reshape(1, -1, 3), luminance_tables()[None]).reshape(bgr.shape)
    return np.asarray(light[..., 0] + light[..., 1] + light[..., 2])


def _brightness(bgr: npt.NDArray[np.uint8] | cv2.typing.MatLike) -> tuple[float, float]:
    step = max(1, max(bgr.shape[:2]) // _SAMPLES_ACROSS)
    first = (min(step, side) // 2 for side in bgr.shape[:2])  # a line camera's picture is very thin
    rows, columns = (slice(at, None, step) for at in first)
    sample = np.ascontiguousarray(bgr[rows, columns], dtype=np.uint8)
    luminance = sum(cv2.mean(cv2.LUT(sample, luminance_tables()[None]))[:3])
    dark = cv2.countNonZero(cv2.inRange(sample, (0, 0, 0), (_BLACK,) * 3))
    bright = cv2.countNonZero(cv2.inRange(sample, (_WHITE,) * 3, (255, 255, 255)))
    return float(luminance), (dark + bright) / (sample.shape[0] * sample.shape[1])
