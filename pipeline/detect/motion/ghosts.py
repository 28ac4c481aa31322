"""Holes in the background: what stood there while it was learned, and has gone.

A hole has the shape of somebody, and stays. What tells it from somebody who stands still is where edges
along its outline are: a person has them in the picture, a hole has them in the background.
"""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.images.decode import Image

Box = tuple[int, int, int, int]

STILL_S = 2.4  # for so long nothing about it has moved
STILL = 0.85  # of its area and that of its place before, shared (intersection over union)
# Edges along the outline: the background's must be stronger by this factor.
STRONGER = 1.4
MARGIN_PX = 3
_BAND = np.ones((3, 3), np.uint8)


class Ghosts:
    """Watches what does not move."""

    def __init__(self) -> None:
        self._still: list[tuple[Box, float]] = []  # boxes, and since when they are where they are

    def find(
        self, boxes: list[Box], image: Image, background: Image, mask: Image, time_s: float
    ) -> list[Box]:
        """Return those of the boxes that are holes in the background.

        Args:
            boxes: x0, y0, x1, y1 of what is connected.
            image: the picture, (h, w, 3).
            background: what is expected there, (h, w, 3).
            mask: 255 where the two differ, (h, w).
            time_s: of the picture; to be called every second or so.
        """
        still = []
        for box in boxes:
            since = (s for before, s in self._still if _shared(box, before) >= STILL)
            still.append((box, min(since, default=time_s)))
        self._still = still
        return [
            box
            for box, since in still
            if time_s - since >= STILL_S and is_hole(box, image, background, mask)
        ]


def is_hole(box: Box, image: Image, background: Image, mask: Image) -> bool:
    """Return whether edges along the outline of what differs are the background's."""
    x0, y0 = max(box[0] - MARGIN_PX, 0), max(box[1] - MARGIN_PX, 0)
    part = slice(y0, box[3] + MARGIN_PX), slice(x0, box[2] + MARGIN_PX)
    outline = cv2.morphologyEx(mask[part], cv2.MORPH_GRADIENT, _BAND)
    now, then = (_edges(picture[part], outline) for picture in (image, background))
    return then > STRONGER * now


def _edges(picture: Image, outline: Image) -> float:
    """Return how strong edges are, on average, along an outline."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    strength = cv2.morphologyEx(grey, cv2.MORPH_GRADIENT, _BAND)
    return float(cv2.mean(strength, mask=outline)[0])


def _shared(a: Box, b: Box) -> float:
    """Return intersection over union."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    shared = width * height
    areas = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1])
    return shared / (areas - shared)
