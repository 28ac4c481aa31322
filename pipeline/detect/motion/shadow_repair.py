"""Repair of silhouettes whose legs or head were taken for shadow.

Grey trousers on grey paving have the colour of a shadow on it. How tall a person is where they stand
tells the two apart: a silhouette that is too short without what was taken away, and right with it, gets
it back. Silhouettes whose ends are the same with and without it need no such help, and so they are the
ones that the height of a person is learned from.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.detect.motion.person_scale import BoxArray, PersonScale
from pipeline.images.decode import Image

TRUNK = 0.55  # of a silhouette, from the top
REACH = 0.25  # of its height: feet are so far from the axis, most of the time
FARTHEST = 1.2  # of its height: what lies below is not its legs
MIN_WIDTH = 0.04
DOUBTFUL = 0.06  # of its height: ends that differ by more are in doubt
BETTER = 0.06  # by how much of the height the right one must be nearer to what is expected


def repair(
    boxes: BoxArray, mask: Image, raw: Image, people: PersonScale
) -> tuple[BoxArray, npt.NDArray[np.bool_]]:
    """Return boxes (n, 4) with ends put right, and of which these are in doubt, (n,).

    Args:
        boxes: silhouettes, in pixels of the masks.
        mask: 255 where bodies are, shadows taken out; what is given back is put into it.
        raw: the same with shadows.
        people: how tall a person is.
    """
    boxes = boxes.copy()
    doubt = np.zeros(len(boxes), dtype=bool)
    for i, (x0, y0, x1, y1) in enumerate(boxes.tolist()):
        tall = y1 - y0
        trunk = mask[y0 : y0 + max(round(TRUNK * tall), 1), x0:x1]
        filled = cv2.reduce(trunk, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[0].cumsum()
        axis = x0 + int(filled.searchsorted(int(filled[-1]) / 2))
        left, right = max(axis - round(REACH * tall), 0), axis + round(REACH * tall) + 1
        top, bottom = _reach(raw, left, right, y0, y1)
        if bottom - y1 <= DOUBTFUL * tall and y0 - top <= DOUBTFUL * tall:
            continue
        doubt[i] = True
        if not people.known:
            continue
        ends = [(y0, y1), (y0, bottom), (top, y1), (top, bottom)]
        expected = people.height_px([b for _, b in ends], axis)
        off = [abs(np.log((b - a) / e)) for (a, b), e in zip(ends, expected.tolist(), strict=True)]
        best = int(np.nanargmin(off)) if np.isfinite(off).any() else 0
        if best and off[best] < off[0] - BETTER:
            a, b = ends[best]
            mask[a:b, left:right] |= raw[a:b, left:right]
            boxes[i] = [min(x0, left), a, max(x1, right), b]
            x, _, wide, _ = cv2.boundingRect(mask[a:b, boxes[i, 0] : boxes[i, 2]])
            boxes[i, 0], boxes[i, 2] = boxes[i, 0] + x, boxes[i, 0] + x + wide
    return boxes, doubt


def _reach(raw: Image, left: int, right: int, y0: int, y1: int) -> tuple[int, int]:
    """Return how far up and down from rows y0 to y1 what is in some columns goes on."""
    far = round(FARTHEST * (y1 - y0))
    begin, end = max(y0 - far, 0), min(y1 + far, raw.shape[0])
    width = cv2.reduce(raw[begin:end, left:right], 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0]
    empty = width < 255 * max(MIN_WIDTH * (y1 - y0), 1)
    above, below = empty[: y0 - begin].nonzero()[0], empty[y1 - begin :].nonzero()[0]
    top = begin + int(above[-1]) + 1 if len(above) else begin
    bottom = y1 + int(below[0]) if len(below) else end
    return top, bottom
