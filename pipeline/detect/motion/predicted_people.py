"""Boxes predicted from the previous frames, and which of their ends a silhouette shows.

A person who was seen alone has a known height, and walks on. When their silhouette runs together with
another one, with a sign's edge or with nothing at all (legs behind a parked car), the head is sought
near where it must be, and the feet, and an end that is not seen follows from the one that is.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import BoolArray, FloatArray
from pipeline.images.decode import Image

# Shares of the height. Half of the body's width, which is taken for theirs; how far beside it their feet
# are; how far from where they must be ends are sought: a stride's bob and what a prediction errs.
SIDE = 0.17
STEP = 0.25
SPINE = 0.08
NEAR = 0.15
HIGHER_THAN_FEET = 0.45  # head and trunk are above
FILLED = 0.5  # of them: it is a person
SHOULDERS = 0.26
SHOWN = 0.15  # of the body's area, at least, is seen of somebody: half of head and trunk
FOOT = 0.05  # fewest pixels in a row that are a foot
WITHIN = 0.5  # of a body's area, that lies in a silhouette which may be theirs
WIDEST = 0.62  # of the height: what is wider was no one person


class Known(NamedTuple):
    """People of the frames before, (k,) each, in pixels of the mask."""

    column: FloatArray  # of the body's axis
    foot: FloatArray  # row below the feet
    tall: FloatArray

    @staticmethod
    def of_boxes(boxes: FloatArray) -> Known:
        """Return those of boxes (n, 4) that can be one person's, in their order."""
        wide, tall = boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1]
        one = (wide <= WIDEST * tall) & (tall > 0)
        column = (boxes[:, 0] + boxes[:, 2]) / 2
        return Known(column[one], boxes[one, 3], tall[one])

    def take(self, which: BoolArray) -> Known:
        """Return some of them."""
        return Known(self.column[which], self.foot[which], self.tall[which])

    def within(self, boxes: npt.NDArray[np.intp]) -> BoolArray:
        """Return whose bodies lie in which boxes (n, 4), for the greater part, (n, k)."""
        left, right = self.column - SIDE * self.tall, self.column + SIDE * self.tall
        width = np.minimum(boxes[:, 2:3], right) - np.maximum(boxes[:, 0:1], left)
        height = np.minimum(boxes[:, 3:4], self.foot) - np.maximum(
            boxes[:, 1:2], self.foot - self.tall
        )
        shared = np.maximum(width, 0) * np.maximum(height, 0)
        return np.asarray(shared > WITHIN * 2 * SIDE * self.tall**2)


class Place(NamedTuple):
    """Place of a person in a silhouette, in its pixels, and which ends are not seen."""

    axis: int
    top: int
    bottom: int
    top_unseen: bool
    bottom_unseen: bool


def place(full: Image, rest: Image, column: float, foot: float, tall: float) -> Place | None:
    """Return the place of a known person in a silhouette; None if too little of them shows.

    Args:
        full: 255 where the silhouette is.
        rest: the same less those who are nearer.
        column: where their axis must be, in its pixels.
        foot: the row below their feet.
        tall: how tall they are.
    """
    axis = _axis(rest, column, foot, tall)
    if axis is None:
        return None
    side = max(round(SIDE * tall), 1)
    low, high = max(round(foot - tall), 0), max(round(foot), 0)
    shown = cv2.countNonZero(rest[low:high, max(axis - side, 0) : axis + side + 1])
    if shown < SHOWN * 2 * SIDE * tall * tall:
        return None
    top = _top(full, rest, axis, foot - tall, tall)
    bottom = _bottom(full, rest, axis, foot, tall)
    if top is not None and bottom is not None:
        return Place(axis, top, bottom, False, False)
    if top is not None:
        return Place(axis, top, top + round(tall), False, True)
    if bottom is not None:
        return Place(axis, bottom - round(tall), bottom, True, False)
    return None


def _axis(rest: Image, column: float, foot: float, tall: float) -> int | None:
    """Return the column of head and trunk near the predicted one; None if no person is there."""
    high = max(round(foot - tall), 0)
    low = max(round(foot - HIGHER_THAN_FEET * tall), 0)
    first = max(round(column - STEP * tall), 0)
    trunk = rest[high:low, first : max(round(column + STEP * tall) + 1, 0)]
    if trunk.size == 0:
        return None
    filled = cv2.reduce(trunk, 0, cv2.REDUCE_AVG, dtype=cv2.CV_32F) / 255.0
    spine, body = (
        cv2.blur(filled, (2 * round(half * tall) + 1, 1), borderType=cv2.BORDER_CONSTANT)[0]
        for half in (SPINE, SHOULDERS / 2)
    )
    if spine.max() < FILLED:
        return None
    away = np.abs(np.arange(len(body)) + first - column) / tall
    return first + int(np.argmax(np.where(spine < FILLED, -1.0, body - away)))


def _top(full: Image, rest: Image, axis: int, head: float, tall: float) -> int | None:
    """Return the uppermost row of a head near where it must be, None where nothing is free above."""
    reach = max(round(SPINE * tall), 1)
    columns = slice(max(axis - reach, 0), axis + reach + 1)
    first, last = round(head - NEAR * tall), round(head + NEAR * tall) + 1
    if last <= 0:
        return None
    strip = full[max(first, 0) : last, columns]
    if strip.size == 0:
        return None
    filled = cv2.reduce(strip, 1, cv2.REDUCE_AVG, dtype=cv2.CV_32F)[:, 0] > 255 * 0.2
    empty = (~filled).nonzero()[0]
    if len(empty) == 0 and first >= 0:
        return None
    row = max(first, 0) + (int(empty[-1]) + 1 if len(empty) else 0)
    # what is below must be theirs, and not a nearer person's head
    own = rest[row : row + reach, columns]
    if row >= last or own.size == 0 or cv2.countNonZero(own) < 0.3 * own.size:
        return None
    return row


def _bottom(full: Image, rest: Image, axis: int, foot: float, tall: float) -> int | None:
    """Return the row below the feet near where they must be, None where they are hidden."""
    reach = max(round(STEP * tall), 1)
    left = max(axis - reach, 0)
    first, last = max(round(foot - NEAR * tall), 0), round(foot + NEAR * tall) + 1
    strip = rest[first:last, left : axis + reach + 1]
    if strip.size == 0:
        return None
    width = cv2.reduce(strip, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0]
    rows = (width >= 255 * max(FOOT * tall, 1)).nonzero()[0]
    if len(rows) == 0:
        return None
    row = first + int(rows[-1]) + 1
    if row >= last and row < full.shape[0]:
        return None  # it goes on: somebody else's, or a shadow
    columns = rest[row - 1, left : axis + reach + 1] > 0
    below = full[row : row + 2, left : axis + reach + 1][:, columns]
    if below.size and (below > 0).mean() > 0.5:
        return None  # a nearer person hides them
    return row
