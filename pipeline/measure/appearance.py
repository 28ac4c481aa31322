"""Colours of torso and legs: by them people who have met are told apart afterwards."""

from __future__ import annotations

import cv2
import numpy as np
import pyarrow as pa

from pipeline.core.arrays import FloatArray
from pipeline.images.decode import Picture

# Parts of a box from its upper edge, as shares of its height: torso and legs, without head and feet.
PARTS = ((0.16, 0.50), (0.50, 0.88))
# Either side of the middle, as a share of the width: the background is beside that. Shoulders are a
# quarter of a person's height, so a wider box is not all person.
HALF_WIDTH, WIDEST = 0.32, 0.40
ACROSS, DOWN = 8, 16  # pixels that are looked at, in each part
HUES, SATURATIONS, VALUES = 8, 4, 16
GREY = 30  # saturation below which a hue says nothing
COLOURS = len(PARTS) * (HUES * SATURATIONS + VALUES)
_X = (2 * (np.arange(ACROSS) + 0.5) / ACROSS - 1.0) * HALF_WIDTH
_Y = np.concatenate([low + (high - low) * (np.arange(DOWN) + 0.5) / DOWN for low, high in PARTS])


def colours(picture: Picture, bbox_xyxy_px: FloatArray) -> FloatArray:
    """Return square roots of the shares of colours in boxes (n, 4), (n, COLOURS).

    Their scalar product is the mean Bhattacharyya coefficient of the parts: 1 for equal ones.
    """
    count = len(bbox_xyxy_px)
    height, width = picture.bgr.shape[:2]
    box = (bbox_xyxy_px + 0.5) / picture.reduction - 0.5
    wide = np.minimum(box[:, 2] - box[:, 0], WIDEST * (box[:, 3] - box[:, 1]))
    x = ((box[:, 0] + box[:, 2]) / 2)[:, None] + wide[:, None] * _X
    y = box[:, 1:2] + (box[:, 3] - box[:, 1])[:, None] * _Y
    column = np.clip(np.rint(x), 0, width - 1).astype(np.intp)
    row = np.clip(np.rint(y), 0, height - 1).astype(np.intp)
    pixels = picture.bgr[row[:, :, None], column[:, None, :]]  # (n, parts * DOWN, ACROSS, 3)
    hsv = cv2.cvtColor(pixels.reshape(count, -1, 3), cv2.COLOR_BGR2HSV).astype(np.intp)
    hue, saturation, value = hsv.reshape(count * len(PARTS), -1, 3).transpose(2, 0, 1)
    bins = HUES * SATURATIONS + VALUES
    part = np.arange(count * len(PARTS))[:, None] * bins
    coloured = saturation > GREY
    colour = np.minimum(hue // 23, HUES - 1) * SATURATIONS
    colour = colour + np.minimum(saturation // 48, SATURATIONS - 1)
    seen = np.bincount((part + colour)[coloured], minlength=count * len(PARTS) * bins)
    bright = part + HUES * SATURATIONS + value // VALUES
    seen = seen + np.bincount(bright.ravel(), minlength=count * len(PARTS) * bins)
    shares = seen.reshape(count, len(PARTS), bins).astype(np.float64)
    shares /= len(PARTS) * shares.sum(axis=2, keepdims=True)
    return np.asarray(np.sqrt(shares).reshape(count, COLOURS))


def packed(shares: FloatArray) -> list[bytes | None]:
    """Return colours (n, c) as a byte each, to be stored until tracks are linked."""
    return [row.tobytes() for row in np.rint(255 * shares).astype(np.uint8)]


def unpacked(column: pa.ChunkedArray) -> FloatArray:
    """Return packed colours (n, c); NaN where there are none."""
    found = np.full((len(column), COLOURS), np.nan)
    known = np.flatnonzero(column.is_valid().to_numpy())
    if len(known):
        joined = b"".join(column.drop_null().to_pylist())
        found[known] = np.frombuffer(joined, np.uint8).reshape(-1, COLOURS) / 255.0
    return found
