"""Region of interest in which one object stands before a plain background: the paper's cropping.

The paper crops the object by hand. Here the region is given once, and in every frame the object's
edges inside it are found to a fraction of a pixel: where the profile of the contrast against the
region's border crosses half of its height.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.config import CameraConfig, DetectConfig
from pipeline.core.errors import UsageError
from pipeline.core.records import Boxes, Expected, Frame
from pipeline.images.decode import Picture, relative_luminance_of

# The border of the region that is taken to be background, as a share of its side.
BORDER = 0.05
# Lines to either side of where the contrast begins that belong to the step: a lens and JPEG spread an
# edge over two or three pixels.
REACH = 3
# The profile must rise above the spread of the border by this factor, or there is no object.
CONTRAST = 5.0
# The object begins where this share of its greatest contrast is reached: a wall's texture is less, a
# metal rim is more.
SHARE = 0.2


class RoiDetector:
    """Measures the one object inside a camera's region of interest."""

    name = "roi"
    learning_s = 0.0
    full_resolution = True
    runs_on_opencv = False

    def __init__(self, camera: CameraConfig) -> None:
        if len(camera.roi_xyxy_px) != 4 or not _ordered(camera.roi_xyxy_px):
            raise UsageError(
                f"camera {camera.name!r} has no region of interest",
                remedy="Give roi_xyxy_px = [x_min, y_min, x_max, y_max] in the camera file",
            )
        self._roi = camera.roi_xyxy_px

    def prepared(self, picture: Picture) -> Picture:
        """Return it as it is."""
        return picture

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Learn nothing."""

    def detect(
        self, frame: Frame, picture: Picture | None, expected: Expected | None = None
    ) -> Boxes:
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

    `lines[i]` is one line across the axis along which the object begins and ends. An edge is the
    middle of the step in contrast where the object first, and last, stands out from the border.
    """
    count = len(lines)
    border = max(1, round(BORDER * count))
    edge_lines = np.concatenate([lines[:border], lines[-border:]])
    contrast = np.abs(lines - np.median(edge_lines, axis=0)).mean(axis=1)
    noise = np.concatenate([contrast[:border], contrast[-border:]])
    floor, spread = float(np.median(noise)), float(np.std(noise)) + 1e-4
    step = max(CONTRAST * spread, SHARE * float(contrast.max() - floor))
    inside = np.flatnonzero(contrast > floor + step)
    if len(inside) < 3 or inside[0] < border or inside[-1] >= count - border:
        return None
    first = _edge(np.diff(contrast), int(inside[0]) - 1, spread)
    last = _edge(-np.diff(contrast), int(inside[-1]), spread)
    return first, last


def _edge(rise: FloatArray, at: int, noise: float) -> tuple[float, float]:
    """Return the centre of gravity of the step around `at`, where `rise[i]` is from i to i + 1.

    The standard deviation is that of the centre of gravity when each rise is off by the noise of two
    lines.
    """
    low, high = max(at - REACH, 0), min(at + REACH + 1, len(rise))
    weight = np.maximum(rise[low:high], 0.0)
    position = np.arange(low, high) + 0.5
    centre = float((weight * position).sum() / weight.sum())
    std = noise * np.sqrt(2 * ((position - centre) ** 2).sum()) / float(weight.sum())
    return centre, float(std)


def make(config: DetectConfig, camera: CameraConfig) -> RoiDetector:
    """Return the detector, for the table `DETECTORS`.

    Raises:
        UsageError: the camera has no region of interest.
    """
    return RoiDetector(camera)
