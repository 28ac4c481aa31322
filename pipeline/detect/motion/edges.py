"""Ends of a silhouette, to a fraction of a pixel.

The mask says which rows a body reaches; the difference to the background says where within them. A
sensor pixel that is half covered differs half as much, so an edge is where the difference falls through
half of what it is inside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot
from typing import NamedTuple

import cv2
import numpy as np

from pipeline.images.decode import Image

Box = tuple[int, int, int, int]  # x0, y0, x1, y1, ends excluded
Unshaded = Callable[[Sequence[Box]], Sequence[Image]]
Ends = tuple[list[float], list[float]]  # where they are, and how far off they may be

# The body's columns lie within this share of its height beside the middle of head and trunk: half of a
# long step (Drillis and Contini 1966: a leg is 0.53 of the stature; strides open it by 60 degrees).
REACH = 0.33
TRUNK = 0.55  # of the height, from the top: head and trunk
# A silhouette's end is where this share of its typical width is reached: hair and shoes count, a
# speck above or below does not.
END_WIDTH = 0.22
# Rows from the end, as a share of the height, that show the contrast of what ends there: half of a head,
# and a shoe.
HEAD_ROWS, SHOE_ROWS = 0.06, 0.05
MIN_INNER = 3
# Of these rows, in order of their contrast, the one at this share is taken: not the first, half of which
# are beyond the edge, and not a bright face below dark hair.
PLATEAU = 0.6
# The lowest part of a silhouette, in which the ground's soft shadow below the feet is looked for, and how
# far that shadow reaches, as shares of the height.
FEET, CONTACT_SHADOW = 0.2, 0.12
SHADED = 0.7  # of the contrast of what ends, at most, is that of the shaded ground beside it
UNSHADED = 9  # levels that are no shadow, as those of the background
# How far an end lies from the true one, one sigma: in pixels of the reduced picture, and at the feet,
# where shoes may have the colour of the ground or of its shade, a share of the height. The errors have
# long tails: so much holds 95 % of them within two sigmas on simulated cameras (bench/boxes.py).
END_STD_PX, FOOT_STD = 0.7, 0.02
BEYOND = 3  # rows outside, which show the difference where nothing is
MIN_ROWS, MIN_COLUMNS = 4, 2
# Where shoes cannot be told from their shadow, the silhouette reaches this far into its soft edge.
HIDDEN_PX, HIDDEN_STD_PX = 1.5, 1.5
_NEAR = np.ones((5, 3), np.uint8)  # what taking shadows out may have cost a foot


class _Outline(NamedTuple):
    """Edges of a silhouette by the mask, in whole pixels."""

    box: Box  # of the body, without specks
    trunk: slice  # the columns in which a body can be
    feet: Box  # its lowest part, and what is below


def ends_of(
    mask: Image, difference: Image, unshaded: Unshaded, boxes: Sequence[Box]
) -> list[Ends | None]:
    """Return the four ends of each silhouette and their standard deviations; None if it has none.

    Args:
        mask: 255 where bodies are, shadows taken out, (h, w).
        difference: to the background, (h, w).
        unshaded: gives, of parts of the picture, the difference to the background in any shade.
        boxes: of the silhouettes, in pixels from the corner.
    """
    outlines = [_outline(mask, box) for box in boxes]
    # All feet at once: what is done to each pixel of them costs more in calls than in pixels.
    parts = iter(unshaded([outline.feet for outline in outlines if outline is not None]))
    found: list[Ends | None] = []
    for outline in outlines:
        if outline is None:
            found.append(None)
            continue
        left, top_row, right, bottom_row = outline.box
        tall = bottom_row - top_row
        top = _refined(mask, difference, outline.trunk, top_row, -1, HEAD_ROWS * tall)
        bottom, bottom_std = _standing(mask, difference, next(parts), outline)
        side_std = hypot(END_STD_PX, 0.03 * tall)
        std = [side_std, END_STD_PX, side_std, hypot(bottom_std, FOOT_STD * tall)]
        found.append(([float(left), top, float(right), bottom], std))
    return found


def _outline(mask: Image, box: Box) -> _Outline | None:
    x0, y0, x1, y1 = box
    part = mask[y0:y1, x0:x1]
    first, last = _columns(part)
    if last - first < MIN_COLUMNS:
        return None
    part = part[:, first:last]
    rows = cv2.reduce(part, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0]
    covered = rows[rows > 0]
    if len(covered) < MIN_ROWS:
        return None
    covered.sort()
    level = max(END_WIDTH * covered.item(len(covered) // 2), 255.0)
    long = (rows >= level).nonzero()[0]
    if len(long) < MIN_ROWS:
        return None
    low, high = long.item(0), long.item(-1) + 1
    x, _, wide, _ = cv2.boundingRect(part[low:high])
    left, right, bottom = x0 + first + x, x0 + first + x + wide, y0 + high
    begin = bottom - max(round(FEET * (high - low)), MIN_ROWS)
    below = min(bottom + BEYOND, mask.shape[0])
    return _Outline(
        (left, y0 + low, right, bottom), slice(x0 + first, x0 + last), (left, begin, right, below)
    )


def _standing(
    mask: Image, difference: Image, unshaded: Image, outline: _Outline
) -> tuple[float, float]:
    """Return where feet end above the shadow in which they stand, and its standard deviation."""
    x0, begin, x1, below = outline.feet
    _, top, _, y1 = outline.box
    tall = y1 - top
    clear = cv2.compare(unshaded, UNSHADED, cv2.CMP_GT)
    near = cv2.dilate(mask[begin:below, x0:x1], _NEAR)
    cv2.bitwise_and(clear, near, dst=clear)
    rows = cv2.reduce(clear, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0].tolist()
    last = len(rows) - 1
    while last >= 0 and rows[last] < 255:
        last -= 1
    shadow = y1 - 1 - begin - last
    if last < 1 or shadow > max(CONTACT_SHADOW * tall, 2):
        # shoes of the shadow's own colour: the mask goes on into its soft edge
        bottom = _refined(mask, difference, slice(x0, x1), y1 - 1, +1, SHOE_ROWS * tall)
        return bottom - HIDDEN_PX, HIDDEN_STD_PX
    # What is half shoe and half ground looks like shade: where within its pixel the shoe ends is seen in
    # the plain difference, beside that of the shaded ground below.
    differs = difference[begin:below, x0:x1]
    bottom = _refined(clear, differs, slice(0, x1 - x0), last, +1, SHOE_ROWS * tall)
    return begin + bottom, END_STD_PX


def _columns(part: Image) -> tuple[int, int]:
    """Return first and last + 1 of the columns in which a body can be, by its head and trunk."""
    height, width = part.shape
    trunk = part[: max(round(TRUNK * height), 1)]
    filled = cv2.reduce(trunk, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[0].cumsum()
    total = filled.item(-1)
    if total == 0:
        return 0, 0
    middle = int(filled.searchsorted(total / 2))
    reach = max(round(REACH * height), 1)
    return max(middle - reach, 0), min(middle + reach + 1, width)


def _refined(
    mask: Image, difference: Image, columns: slice, row: int, step: int, depth: float
) -> float:
    """Return where the difference falls to half of what it is inside, near the mask's last row.

    Args:
        mask: 255 where a body is.
        difference: to the background.
        columns: of the body.
        row: the mask's last row.
        step: -1 for an upper, +1 for a lower end.
        depth: rows, from the end, that show what ends there.
    """
    height = mask.shape[0]
    inner = max(round(depth), MIN_INNER)
    if step > 0:
        first, last = max(row - inner, 0), min(row + BEYOND + 1, height)
        tip = mask[max(row - 1, 0) : row + 1, columns]
    else:
        first, last = max(row - BEYOND, 0), min(row + inner + 1, height)
        tip = mask[row : row + 2, columns]
    x, _, wide, _ = cv2.boundingRect(tip)
    x += columns.start
    # The end is the farthest that any column reaches: heads and shoes are round.
    ahead = cv2.blur(difference[first:last, x : x + wide], (3, 1))
    profile = cv2.reduce(ahead, 1, cv2.REDUCE_MAX)[:, 0].tolist()  # from outside inwards
    edge = row - first
    if step > 0:
        profile.reverse()
        edge = last - 1 - row
    inside = sorted(profile[edge : edge + inner + 1])
    full = inside[int(PLATEAU * len(inside))]
    outside = profile[0]
    half = (full + min(outside, SHADED * full)) / 2
    # what is dim within does not end it
    i, end = max(edge - 1, 0), len(profile) - 1
    while profile[i] <= half and i < end:
        i += 1
    beyond = profile[i - 1] if i else outside
    share = (profile[i] - half) / max(profile[i] - beyond, 1e-6)
    return row + step * (edge - i) + 0.5 + step * min(max(share, 0.0), 1.0)
