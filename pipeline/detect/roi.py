"""A region of interest in which one object stands before a plain background: the paper's cropping.

The paper crops the object by hand. Here the region is given once, and in every frame the object's
edges inside it are found to a fraction of a pixel: where the profile of the contrast against the
region's border crosses half of its height.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.config import CameraConfig
from pipeline.errors import UsageError
from pipeline.picture import Picture, relative_luminance_of
from pipeline.records import Boxes, FloatArray, Frame

# The border of the region that is taken to be background, as a share of its side.
BORDER = 0.05
# The profile must rise above the spread of the border by this factor, or there is no object.
CONTRAST = 5.0


class RoiDetector:
    """Measures the one object inside a camera's region of interest."""

    name = "roi"
    learning_s = 0.0
    full_resolution = True

    def __init__(self, camera: CameraConfig) -> None:
        if len(camera.roi_xyxy_px) != 4 or not _ordered(camera.roi_xyxy_px):
            raise UsageError(
                f"camera {camera.name!r} has no region of interest",
                remedy="Give roi_xyxy_px = [x_min, y_min, x_max, y_max] in the camera file",
            )
        self._roi = camera.roi_xyxy_px

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Learn nothing."""

    def detect(self, frame: Frame, picture: Picture | None) -> Boxes:
        """Return the object's box, or none if nothing stands out in the region."""
        if picture is None:
            return Boxes.empty()
        x0, y0 = (max(round(v), 0) for v in self._roi[:2])
        x1 = min(round(self._roi[2]) + 1, picture.width_px)
        y1 = min(round(self._roi[3]) + 1, picture.height_px)
        if x1 - x0 < 8 or y1 - y0 < 8:
            return Boxes.empty()
        region = relative_luminance_of(picture.bgr[y0:y1, x0:x1])
        across = _ends(region.T)
        along = _ends(region)
        if across is None:
            return Boxes.empty()
        # An object that leaves the region above and below (a staff) fills it: its height is cut.
        low, high = along if along is not None else ((-0.5, 0.0), (y1 - y0 - 0.5, 0.0))
        left, right = across
        edges = [x0 + left[0], y0 + low[0], x0 + right[0], y0 + high[0]]
        std = [left[1], low[1], right[1], high[1]]
        return Boxes(
            np.array([edges]), np.array([1.0]), ("object",), np.maximum([std], 0.05), (None,)
        )


def _ordered(roi: tuple[float, ...]) -> bool:
    return roi[0] < roi[2] and roi[1] < roi[3]


def _ends(lines: FloatArray) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return position and standard deviation of the first and last edge over lines (n, m).

    `lines[i]` is one line across the axis along which the object begins and ends. An edge is where
    the contrast crosses half of the object's median contrast.
    """
    count = len(lines)
    border = max(1, round(BORDER * count))
    edge_lines = np.concatenate([lines[:border], lines[-border:]])
    contrast = np.abs(lines - np.median(edge_lines, axis=0)).mean(axis=1)
    noise = contrast[:border].tolist() + contrast[-border:].tolist()
    floor, spread = float(np.median(noise)), float(np.std(noise)) + 1e-4
    inside = contrast > floor + CONTRAST * spread
    if inside.sum() < 3 or inside[0] or inside[-1]:
        return None
    level = (floor + float(np.median(contrast[inside]))) / 2
    above = np.flatnonzero(contrast >= level)
    if len(above) == 0 or above[0] == 0 or above[-1] == count - 1:
        return None
    return (
        _crossing(contrast, int(above[0]) - 1, level, spread),
        _crossing(contrast, int(above[-1]), level, spread),
    )


def _crossing(contrast: FloatArray, at: int, level: float, noise: float) -> tuple[float, float]:
    """Return where the profile crosses `level` between `at` and `at + 1`, and how surely."""
    rise = float(contrast[at + 1] - contrast[at])
    return at + (level - float(contrast[at])) / rise, noise / abs(rise)
