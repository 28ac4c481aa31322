"""Straight edges of the background: posts, walls, doors. They tell which way is up.

A camera's pictures are looked at now and then; their median shows the place without those who walk
through, and a line segment detector (von Gioi et al. 2012) finds its straight edges, once a recording.
"""

from __future__ import annotations

import cv2
import numpy as np
import pyarrow as pa

from pipeline.core.arrays import FloatArray
from pipeline.core.tables import BACKGROUND_LINES
from pipeline.images.decode import Image, Picture

KEPT = 15  # pictures, of which a median is taken: nobody stands at one place in eight of them
MAX_HEIGHT_PX = 1080  # of the pictures kept
MIN_LENGTH = 0.03  # of the picture's height: the direction of shorter ones is too unsure


class Backdrop:
    """Pictures of one camera spread evenly over all that was seen, however long it goes on."""

    def __init__(self) -> None:
        self._kept: list[Image] = []
        self._every = 1
        self._seen = 0
        self._size = (0, 0)  # of the stored picture

    def add(self, picture: Picture | None) -> None:
        """Look at the next picture."""
        if picture is None:
            return
        if self._size != (picture.width_px, picture.height_px):
            self._kept, self._every, self._seen = [], 1, 0
            self._size = (picture.width_px, picture.height_px)
        if self._seen % self._every == 0:
            self._kept.append(_grey(picture.bgr))
        self._seen += 1
        if len(self._kept) == 2 * KEPT:
            self._kept, self._every = self._kept[::2], 2 * self._every

    def lines(self, camera: str) -> pa.Table:
        """Return the straight edges, in the schema of the table `background_lines`."""
        ends = self._segments()
        columns = [pa.array([camera] * len(ends)), *(pa.array(ends[:, i]) for i in range(4))]
        return pa.Table.from_arrays(columns, schema=BACKGROUND_LINES)

    def _segments(self) -> FloatArray:
        if len(self._kept) < 3:
            return np.empty((0, 4))
        chosen = np.linspace(0, len(self._kept) - 1, min(KEPT, len(self._kept))).round().astype(int)
        still = np.median(np.stack([self._kept[i] for i in chosen]), axis=0).astype(np.uint8)
        found = cv2.createLineSegmentDetector().detect(still)[0]
        if found is None:
            return np.empty((0, 4))
        ends = np.asarray(found, dtype=np.float64).reshape(-1, 4)
        long = np.hypot(*(ends[:, 2:] - ends[:, :2]).T) >= MIN_LENGTH * still.shape[0]
        scale = np.array(self._size) / [still.shape[1], still.shape[0]]
        return np.asarray((ends[long] + 0.5) * np.tile(scale, 2) - 0.5)


def _grey(bgr: Image) -> Image:
    grey = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY) if bgr.ndim == 3 else bgr
    scale = MAX_HEIGHT_PX / grey.shape[0]
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, dtype=np.uint8)
