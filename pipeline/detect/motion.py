"""People and things that move before a fixed camera: silhouettes against the learned background.

    difference -> shadows out -> silhouettes -> fragments joined, groups split -> tight ends

Lengths are shares of the picture or of the object, never pixels: a recording may have any size.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.config import DetectConfig
from pipeline.detect.background import Background
from pipeline.detect.people import PERSON_ASPECT, PersonScale, join_parts, split_groups
from pipeline.picture import Image, Picture
from pipeline.records import Boxes, FloatArray, Frame

# The silhouettes are joined and labelled at no more than this height: enough for a person of a
# twentieth of the picture, and labelling costs by the pixel.
LABEL_HEIGHT_PX = 240
# Columns of a silhouette lower than this share of its tallest are shadow or clutter at its side.
SIDE_LOBE = 0.35
# A silhouette's end is where this share of its typical width is reached: hair and shoes count, a
# speck above or below does not.
END_WIDTH = 0.25
# How far an end lies from the body's true end, one sigma, in pixels of the reduced picture beside
# what the silhouette itself shows: the blur of a half-covered pixel and of compression.
END_STD_PX = 0.7


class MotionDetector:
    """Finds what moves; the background is learned from the recording's beginning."""

    name = "motion"
    full_resolution = False

    def __init__(self, config: DetectConfig) -> None:
        self.learning_s = config.learning_s
        self._min_height = config.min_height
        self._background: Background | None = None
        self._shape: tuple[int, ...] = ()
        self._scale = PersonScale()

    def learn(self, pictures: Sequence[Picture]) -> None:
        """Learn background and size of people from pictures spread over time, of the commonest size."""
        shapes = [p.bgr.shape for p in pictures]
        if not shapes:
            return
        self._shape = max(set(shapes), key=shapes.count)
        alike = [p.bgr for p in pictures if p.bgr.shape == self._shape]
        self._background = Background(alike)
        for image in alike:
            mask, _ = _foreground(self._background, image)
            self._scale.learn(self._silhouettes(mask))

    def detect(self, frame: Frame, picture: Picture | None) -> Boxes:
        """Return what stands before the background."""
        if picture is None:
            return Boxes.empty()
        if self._background is None or picture.bgr.shape != self._shape:
            # A new picture size is a new view: begin again with what is there.
            self._shape = picture.bgr.shape
            self._background, self._scale = Background([picture.bgr]), PersonScale()
        background, image = self._background, picture.bgr
        mask, difference = _foreground(background, image)
        found = self._silhouettes(mask)
        self._scale.learn(found)
        occupied = np.zeros_like(mask)
        for x0, y0, x1, y1 in found:
            occupied[y0:y1, x0:x1] = 255
        background.follow(image, occupied, frame.capture_time_ns / 1e9)
        return _tighten(found, mask, difference, picture, self._min_height)

    def _silhouettes(self, mask: Image) -> npt.NDArray[np.intp]:
        return _silhouettes(mask, self._min_height * mask.shape[0], self._scale)


def _foreground(background: Background, image: Image) -> tuple[Image, Image]:
    """Return where something stands before the background, and how it differs."""
    difference = background.difference(image)
    mask = background.foreground(difference)
    background.remove_shadow(image, mask)
    return mask, difference


def _silhouettes(mask: Image, min_height_px: float, people: PersonScale) -> npt.NDArray[np.intp]:
    """Return boxes (n, 4) x0 y0 x1 y1, ends excluded, of what is connected or belongs together."""
    scale = max(1, round(mask.shape[0] / LABEL_HEIGHT_PX))
    small = cv2.resize(mask, None, fx=1 / scale, fy=1 / scale, interpolation=cv2.INTER_AREA)
    _, small = cv2.threshold(small, 96, 255, cv2.THRESH_BINARY)
    # Specks out, then what is a step apart joined, further up and down than to the sides.
    small = cv2.medianBlur(small, 3)
    small = cv2.morphologyEx(small, cv2.MORPH_CLOSE, np.ones((5, 3), np.uint8))
    # Outlines of a sparse mask are found in a quarter of the time that labelling every pixel takes.
    outlines, _ = cv2.findContours(small, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    rectangles = np.array([cv2.boundingRect(o) for o in outlines], dtype=np.intp).reshape(-1, 4)
    # An outline runs through the middles of its pixels: half of its length is outside the area.
    area = np.array([cv2.contourArea(o) + cv2.arcLength(o, True) / 2 + 1 for o in outlines])
    x, y, width, height = rectangles.T
    big = (area >= 6) & (height >= 2)
    boxes = np.stack([x, y, x + width, y + height], axis=1)[big] * scale
    weight = area[big].astype(np.float64)
    boxes, weight = join_parts(boxes, weight, people)
    size = boxes[:, 2:] - boxes[:, :2]
    tall = size[:, 1] >= min_height_px
    filled = weight * scale**2 / np.maximum(size.prod(axis=1), 1) > 0.2
    kept = np.minimum(boxes[tall & filled], [mask.shape[1], mask.shape[0]] * 2)
    return split_groups(kept, mask, people)


def _tighten(
    found: npt.NDArray[np.intp],
    mask: Image,
    difference: Image,
    picture: Picture,
    min_height: float,
) -> Boxes:
    """Return the boxes with their ends found to a fraction of a pixel, in stored pixels."""
    edges, spreads, scores = [], [], []
    for box in found:
        ends = _ends_of(mask, box)
        if ends is None or ends[0][3] - ends[0][1] < min_height * mask.shape[0]:
            continue
        edges.append(ends[0])
        spreads.append(ends[1])
        scores.append(_score(difference, mask, box))
    if not edges:
        return Boxes.empty()
    # Silhouette coordinates count pixel edges from 0; stored pixels have their centre at 0.
    bbox = np.array(edges) * picture.reduction - 0.5
    size = bbox[:, 2:] - bbox[:, :2]
    aspect = size[:, 1] / np.maximum(size[:, 0], 1e-9)
    person = (aspect >= PERSON_ASPECT[0]) & (aspect <= PERSON_ASPECT[1])
    return Boxes(
        bbox,
        np.array(scores),
        tuple("person" if p else "unknown" for p in person),
        np.array(spreads) * picture.reduction,
        (None,) * len(edges),
    )


def _ends_of(mask: Image, box: npt.NDArray[np.intp]) -> tuple[list[float], list[float]] | None:
    """Return the four ends of a silhouette and their standard deviations, in mask pixels."""
    margin = 2
    x0, y0 = max(box[0] - margin, 0), max(box[1] - margin, 0)
    x1, y1 = min(box[2] + margin, mask.shape[1]), min(box[3] + margin, mask.shape[0])
    part = mask[y0:y1, x0:x1]
    columns = cv2.reduce(part, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[0] / 255.0
    body = columns >= SIDE_LOBE * columns.max(initial=0.0)
    if columns.max(initial=0.0) < 2:
        return None
    first, last = int(np.argmax(body)), len(body) - int(np.argmax(body[::-1]))
    rows = cv2.reduce(part[:, first:last], 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0] / 255.0
    covered = rows[rows > 0]
    level = max(END_WIDTH * float(np.median(covered)), 1.0) if len(covered) else np.inf
    long = np.flatnonzero(rows >= level)
    if len(long) < 2:
        return None
    top, top_std = _end(rows, int(long[0]), -1, level)
    bottom, bottom_std = _end(rows, int(long[-1]), +1, level)
    edges = [x0 + first, y0 + top, x0 + last, y0 + bottom]
    side_std = float(np.hypot(END_STD_PX, 0.05 * (last - first)))
    return [float(e) for e in edges], [side_std, top_std, side_std, bottom_std]


def _end(rows: FloatArray, at: int, step: int, level: float) -> tuple[float, float]:
    """Return where the width falls through `level` beyond row `at`, and its standard deviation.

    Positions count the upper edge of row 0 as 0. How many rows the silhouette takes to fade is how
    unsure its end is: a head ends within a row or two, feet in the grass do not.
    """
    beyond = at + step
    outside = rows[beyond] if 0 <= beyond < len(rows) else 0.0
    share = 1.0 - min(max((level - outside) / max(rows[at] - outside, 1e-9), 0.0), 1.0)
    centre = at + 0.5 + step * share
    full = np.flatnonzero(rows[:: -step if step > 0 else 1] >= 2 * level)
    begin = (len(rows) - 1 - at) if step > 0 else at
    fade = float(full[0] - begin) if len(full) and full[0] > begin else 0.0
    return centre, float(np.hypot(END_STD_PX, fade / 3.0))


def _score(difference: Image, mask: Image, box: npt.NDArray[np.intp]) -> float:
    """Return how clearly an object stands out, 0..1: its mean contrast, 64 levels being certain."""
    x0, y0, x1, y1 = box
    inside = cv2.mean(difference[y0:y1, x0:x1], mask=mask[y0:y1, x0:x1])[0]
    return float(min(inside / 64.0, 1.0))
