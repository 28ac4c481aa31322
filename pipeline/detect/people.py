"""How tall a person is in the picture, and so which silhouettes are one person, several, or a part.

On flat ground before an upright camera, the height of a person in the picture is a linear function of
the row of their feet (both are in proportion to how far the feet are below the horizon). It is learned
from the recording's own silhouettes, with no pose; groups and fragments are outliers to it.
"""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.picture import Image
from pipeline.records import FloatArray

BoxArray = npt.NDArray[np.intp]

# An upright person is 2 to 4.5 times as tall as wide; a stride, a bag or a bicycle makes it less.
PERSON_ASPECT = (1.25, 6.0)
SURE_ASPECT = (1.8, 4.5)

# The fit. Statures differ by 5 %, ends of boxes by a few pixels; more than this is no person.
MIN_SAMPLES = 40
MAX_SAMPLES = 2000
REFIT_EVERY = 100
ROUNDS = 12
MAX_SPREAD = 0.15  # of the height, median

# Shares of a person's height, by the proportions of the body (Drillis and Contini 1966: shoulders 0.26
# of the stature wide, head 0.13 high): two heads are no nearer than a shoulder's width apart, and
# between them the outline falls by most of a head.
HEADS_APART = 0.2
VALLEY = 0.1
# Somebody who stands is 0.3 wide, a stride up to 0.5: from here on a silhouette is searched for heads.
WIDE = 0.45
# What is shorter than this is a part of a person, what is taller than that is more than one.
PART, TOO_TALL = 0.8, 1.3
LOWEST_HEAD = 0.6
CROWN = (0.92, 1.25)  # where the top of a person's head may be, with statures as they differ
WAIST = 0.45  # of the usual width: where one silhouette that touches another may be cut

# Head and legs of one person may be parted by a belt or a bag that looks like the background.
GAP = 0.3  # of the joined height
# Where it is known how tall a person is, also by a sign or a rail before them.
KNOWN_GAP = 0.5
OVERLAP = 0.5  # of the narrower fragment's width


class PersonScale:
    """The height of a person by the row of their feet, learned as recordings go by."""

    def __init__(self) -> None:
        self._samples: list[tuple[float, float]] = []
        self._since = 0
        self._line: FloatArray | None = None

    @property
    def known(self) -> bool:
        """Whether enough upright silhouettes agreed on a line."""
        return self._line is not None

    def height_px(self, foot_row: npt.ArrayLike) -> FloatArray:
        """Return the expected height at rows; NaN where it is not known, or no person would stand."""
        rows = np.asarray(foot_row, dtype=np.float64)
        if self._line is None:
            return np.full(rows.shape, np.nan)
        tall = self._line[0] + self._line[1] * rows
        return np.where(tall > 2, tall, np.nan)

    def learn(self, boxes: BoxArray) -> None:
        """Take silhouettes (n, 4) that look like one upright person into account."""
        if not len(boxes):
            return
        size = boxes[:, 2:] - boxes[:, :2]
        aspect = size[:, 1] / np.maximum(size[:, 0], 1)
        sure = (aspect >= SURE_ASPECT[0]) & (aspect <= SURE_ASPECT[1])
        new = list(zip(boxes[sure, 3].tolist(), size[sure, 1].tolist(), strict=True))
        self._samples += new
        self._since += len(new)
        enough = len(self._samples) >= MIN_SAMPLES
        if enough and (self._line is None or self._since >= REFIT_EVERY):
            self._fit()

    def _fit(self) -> None:
        """Fit a line by least absolute relative deviations (iteratively reweighted)."""
        self._samples = self._samples[-MAX_SAMPLES:]
        self._since = 0
        row, tall = np.array(self._samples, dtype=np.float64).T
        design = np.column_stack([np.ones(len(row)), row])
        weight = 1.0 / tall
        line = np.array([np.median(tall), 0.0])
        for _ in range(ROUNDS):
            line = np.linalg.lstsq(design * weight[:, None], tall * weight, rcond=None)[0]
            off = np.abs(tall - design @ line) / tall
            weight = 1.0 / tall / np.sqrt(np.maximum(off, 0.02))
        # Who is nearer stands lower and is larger; a level line is a view along the ground.
        agrees = np.median(off) <= MAX_SPREAD and line[1] >= 0
        self._line = line if agrees else None


def join_parts(
    boxes: BoxArray, weight: FloatArray, scale: PersonScale
) -> tuple[BoxArray, FloatArray]:
    """Join fragments that lie above each other as the parts of one upright person do.

    Args:
        boxes: (n, 4) x0 y0 x1 y1.
        weight: pixels in each, (n,).
        scale: how tall a person is.
    """
    while len(boxes) > 1:
        cost, joined = _joining(boxes, scale)
        i, j = np.unravel_index(np.argmin(cost), cost.shape)
        if not np.isfinite(cost[i, j]):
            break
        keep = np.ones(len(boxes), dtype=bool)
        keep[[i, j]] = False
        boxes = np.vstack([boxes[keep], joined[:, i, j].astype(np.intp)])
        weight = np.append(weight[keep], weight[i] + weight[j])
    return boxes, weight


def _joining(boxes: BoxArray, scale: PersonScale) -> tuple[FloatArray, FloatArray]:
    """Return what it costs to join each two, (n, n), infinite if they may not, and their boxes."""
    x0, y0, x1, y1 = boxes.T.astype(np.float64)
    shared = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0)
    narrower = np.minimum((x1 - x0)[:, None], x1 - x0)
    top, bottom = np.minimum(y0[:, None], y0), np.maximum(y1[:, None], y1)
    left, right = np.minimum(x0[:, None], x0), np.maximum(x1[:, None], x1)
    gap = np.maximum(y0[:, None], y0) - np.minimum(y1[:, None], y1)
    height, width = bottom - top, right - left
    upright = height / width
    shape = (upright >= PERSON_ASPECT[0]) & (upright <= PERSON_ASPECT[1])
    each = (y1 - y0)[:, None], y1 - y0
    expected = scale.height_px(bottom)
    # Two whole people one behind the other are not parts of one: parts are shorter.
    unknown = (gap <= GAP * height) & (np.minimum(*each) < 0.7 * height)
    known = (gap <= KNOWN_GAP * expected) & (np.minimum(*each) < PART * expected)
    known &= height <= TOO_TALL * expected
    part = (shared >= OVERLAP * narrower) & shape & np.where(np.isnan(expected), unknown, known)
    inside = (shared >= 0.8 * narrower) & (gap <= 0)  # one within the other's outline
    inside &= ~(height > TOO_TALL * expected)
    np.fill_diagonal(part, False)
    np.fill_diagonal(inside, False)
    cost = np.where(part | inside, np.maximum(gap, 0) / height, np.inf)
    return cost, np.array([left, top, right, bottom])


def split_groups(boxes: BoxArray, mask: Image, scale: PersonScale) -> BoxArray:
    """Cut silhouettes of several people into one box each, as far as their outline shows them.

    Args:
        boxes: (n, 4) in pixels of the mask.
        mask: 255 where something stands before the background.
        scale: how tall a person is; if that is not known nothing is cut.
    """
    if not scale.known or not len(boxes):
        return boxes
    expected = scale.height_px(boxes[:, 3])
    size = boxes[:, 2:] - boxes[:, :2]
    large = (size[:, 0] > WIDE * expected) | (size[:, 1] > TOO_TALL * expected)
    if not large.any():
        return boxes
    parts: list[BoxArray] = [boxes[~large]]
    for box, tall in zip(boxes[large], expected[large], strict=True):
        for piece in _cut_across(box, mask, float(tall)):
            parts.append(_cut_between_heads(piece, mask, scale))
    return np.concatenate(parts)


def _cut_across(box: BoxArray, mask: Image, tall: float) -> list[BoxArray]:
    """Cut a silhouette that is too tall where it is thin: somebody nearer before somebody farther."""
    x0, y0, x1, y1 = (int(v) for v in box)
    if y1 - y0 <= TOO_TALL * tall:
        return [box]
    filled = cv2.reduce(mask[y0:y1, x0:x1], 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0] / 255.0
    # Above the head of who stands in front, and not at their neck.
    first, last = max(y1 - round(CROWN[1] * tall), y0), y1 - round(CROWN[0] * tall)
    rows = filled[first - y0 : last - y0]
    if not len(rows) or rows.min() > WAIST * np.median(filled[filled > 0]):
        return [box]
    at = first + int(np.argmin(rows))
    pieces = [np.array([x0, y0, x1, at]), np.array([x0, at, x1, y1])]
    return [p for p in (_shrunk(piece, mask) for piece in pieces) if p is not None]


def _cut_between_heads(box: BoxArray, mask: Image, scale: PersonScale) -> BoxArray:
    """Cut a silhouette that is too wide at the valleys of its upper outline."""
    tall = float(scale.height_px(box[3]))
    x0, y0, x1, y1 = (int(v) for v in box)
    if not x1 - x0 > WIDE * tall:
        return box[None]
    part = cv2.medianBlur(np.ascontiguousarray(mask[y0:y1, x0:x1]), 3) > 0
    outline = np.where(part.any(axis=0), (y1 - y0) - part.argmax(axis=0), 0).astype(np.float32)
    outline = cv2.blur(outline[None], (max(round(0.06 * tall), 1), 1))[0]
    heads = _heads(outline, tall)
    if len(heads) < 2:
        return box[None]
    filled = cv2.blur(part.sum(axis=0, dtype=np.float32)[None], (3, 1))[0]
    cuts = [a + _valley(outline[a:b], filled[a:b], tall) for a, b in pairwise(heads)]
    edges = [x0, *(x0 + c for c in cuts), x1]
    pieces = [np.array([a, y0, b, y1]) for a, b in pairwise(edges)]
    found = [p for p in (_shrunk(piece, mask) for piece in pieces) if p is not None]
    return np.array(found) if found else box[None]


def _valley(outline: FloatArray, filled: FloatArray, tall: float) -> int:
    """Return the column between two heads where least of a body is, in the valley of the outline."""
    low = outline <= outline.min() + VALLEY * tall
    return int(np.argmin(np.where(low, filled, np.inf)))


def _heads(outline: FloatArray, tall: float) -> list[int]:
    """Return the columns of an outline's peaks that are as high and as far apart as heads."""
    reach = 2 * max(round(HEADS_APART * tall), 1) + 1
    highest = cv2.dilate(outline[None], np.ones((1, reach), np.uint8))[0]
    peaks = np.flatnonzero((outline >= highest) & (outline >= LOWEST_HEAD * tall)).tolist()
    heads: list[int] = []
    for peak in peaks:
        if heads:
            valley = float(outline[heads[-1] : peak + 1].min())
            if min(outline[heads[-1]], outline[peak]) - valley < VALLEY * tall:
                if outline[peak] > outline[heads[-1]]:
                    heads[-1] = peak
                continue
        heads.append(peak)
    return heads


def _shrunk(box: BoxArray, mask: Image) -> BoxArray | None:
    """Return the box of what is in a box, or None if nothing is."""
    x0, y0, x1, y1 = (int(v) for v in box)
    x, y, width, height = cv2.boundingRect(np.ascontiguousarray(mask[y0:y1, x0:x1]))
    if width == 0 or height == 0:
        return None
    return np.array([x0 + x, y0 + y, x0 + x + width, y0 + y + height])
