"""Outputs of detection networks, by family, as boxes with scores and classes.

`pipeline.detect.network.families` has the table of the families' outputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.detect.network.families import (
    STRIDES,
    STRIDES_LARGE,
    cell_count,
    unbatched,
    unknown_outputs,
)

Array = npt.NDArray[np.generic]

# Boxes that reach less far than this cannot be in pixels: they are shares of the input's sides.
LARGEST_SHARE = 2.0


@dataclass(frozen=True, slots=True)
class Candidates:
    """Boxes as a network gives them, in pixels of its input counted from the outer edge."""

    bbox: FloatArray  # (n, 4) x0 y0 x1 y1
    score: FloatArray  # (n,)
    class_index: npt.NDArray[np.intp]  # (n,)

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> Candidates:
        """Return those at `index`: positions, or a mask."""
        return Candidates(self.bbox[index], self.score[index], self.class_index[index])


def decode(
    family: str, outputs: Sequence[Array], size: tuple[int, int], class_count: int | None = None
) -> Candidates:
    """Return all boxes that a network gives.

    Args:
        family: one of `FAMILIES`.
        outputs: in the file's order.
        size: width and height of the input.
        class_count: how many classes there are, where values that are no classes follow them.

    Raises:
        UnusableModel: the outputs do not have the family's shapes.
    """
    shapes = [o.shape for o in outputs]
    arrays = [o.reshape(s) for o, s in zip(outputs, unbatched(shapes), strict=True)]
    flat: list[Any] = [
        a if a.dtype.kind in "iu" else a.astype(np.float64) for a in arrays if a.ndim <= 2
    ]
    try:
        found = _DECODERS[family](flat, size, class_count)
    except (_UnfitError, IndexError, ValueError) as error:
        raise unknown_outputs(
            shapes, f"the outputs are not those of the family {family!r}"
        ) from error
    sound = np.isfinite(found.bbox).all(axis=1) & np.isfinite(found.score)
    sound &= (found.bbox[:, 2] > found.bbox[:, 0]) & (found.bbox[:, 3] > found.bbox[:, 1])
    return found.take(sound)


class _UnfitError(Exception):
    """The arrays do not have the family's shapes."""


def _one(flat: list[FloatArray], columns: int) -> FloatArray:
    """Return the only 2-D output, with at least so many columns."""
    tables = [a for a in flat if a.ndim == 2]
    if len(tables) != 1 or tables[0].shape[1] < columns:
        raise _UnfitError
    return tables[0]


def _yolov5(flat: list[FloatArray], size: tuple[int, int], class_count: int | None) -> Candidates:
    table = _one(flat, 6)
    end = None if class_count is None else 5 + class_count
    classes = table[:, 5:end]
    index = classes.argmax(axis=1)
    score = table[:, 4] * classes[np.arange(len(table)), index]
    return Candidates(_corners(table[:, :4]), score, index)


def _yolox(flat: list[FloatArray], size: tuple[int, int], class_count: int | None) -> Candidates:
    """Positions are in cells from the cell's corner, sizes logarithms in strides (Ge et al. 2021)."""
    table = _one(flat, 6).copy()
    strides = next((s for s in (STRIDES, STRIDES_LARGE) if cell_count(size, s) == len(table)), ())
    if not strides:
        raise _UnfitError
    grid, stride = _grid(size, strides)
    table[:, :2] = (table[:, :2] + grid) * stride[:, None]
    with np.errstate(over="ignore"):
        table[:, 2:4] = np.exp(table[:, 2:4]) * stride[:, None]
    return _yolov5([table], size, class_count)


def _yolov8(flat: list[FloatArray], size: tuple[int, int], class_count: int | None) -> Candidates:
    table = _one(flat, 5)
    cells = {cell_count(size, STRIDES), cell_count(size, STRIDES_LARGE)}
    if table.shape[1] in cells:
        table = table.T
    if table.shape[1] < 5:
        raise _UnfitError
    return _boxes_then_classes(table, class_count)


def _boxes_then_classes(table: FloatArray, class_count: int | None) -> Candidates:
    classes = table[:, 4 : None if class_count is None else 4 + class_count]
    index = classes.argmax(axis=1)
    return Candidates(_corners(table[:, :4]), classes[np.arange(len(table)), index], index)


def _end_to_end(
    flat: list[FloatArray], size: tuple[int, int], class_count: int | None
) -> Candidates:
    table = _one(flat, 6)
    return Candidates(_in_pixels(table[:, :4], size), table[:, 4], _whole(table[:, 5]))


def _rtdetr(flat: list[FloatArray], size: tuple[int, int], class_count: int | None) -> Candidates:
    if len(flat) == 1:  # Ultralytics: scores, not logits
        table = _one(flat, 5)
        scaled = np.column_stack([table[:, :4] * np.tile(size, 2), table[:, 4:]])
        return _boxes_then_classes(scaled, class_count)
    boxes, logits = _boxes_and_logits(flat)
    index = logits.argmax(axis=1)
    score = _sigmoid(logits[np.arange(len(logits)), index])
    return Candidates(_corners(boxes * np.tile(size, 2)), score, index)


def _detr(flat: list[FloatArray], size: tuple[int, int], class_count: int | None) -> Candidates:
    """The classes exclude each other, and the last one is that there is nothing (Carion 2020)."""
    boxes, logits = _boxes_and_logits(flat)
    if logits.shape[1] < 2:
        raise _UnfitError
    raised = np.exp(logits - logits.max(axis=1, keepdims=True))
    share = raised / raised.sum(axis=1, keepdims=True)
    index = share[:, :-1].argmax(axis=1)
    score = share[np.arange(len(share)), index]
    return Candidates(_corners(boxes * np.tile(size, 2)), score, index)


def _boxes_and_logits(flat: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Tell boxes, which have four columns, from logits; where both have, boxes are shares 0..1."""
    tables = [a for a in flat if a.ndim == 2]
    boxes = [i for i, a in enumerate(tables) if a.shape[1] == 4]
    if len(tables) != 2 or not boxes or len(tables[0]) != len(tables[1]):
        raise _UnfitError
    at = boxes[0]
    if len(boxes) == 2 and (tables[0] < 0).any():
        at = 1
    return tables[at], tables[1 - at]


def _detections(
    flat: list[FloatArray], size: tuple[int, int], class_count: int | None
) -> Candidates:
    boxes = [a for a in flat if a.ndim == 2 and a.shape[1] == 4]
    rows = [a for a in flat if a.ndim == 1]
    if len(boxes) != 1 or len(rows) != 2 or any(len(r) != len(boxes[0]) for r in rows):
        raise _UnfitError
    integers = [r.dtype.kind in "iu" for r in rows]
    if integers[0] == integers[1]:  # both are floats: labels are whole, scores are not
        integers = [bool((r == np.rint(r)).all()) for r in rows]
    labels, score = rows if integers[0] else rows[::-1]
    return Candidates(_in_pixels(boxes[0], size), score.astype(np.float64), _whole(labels))


_DECODERS = {
    "yolov5": _yolov5,
    "yolov8": _yolov8,
    "yolox": _yolox,
    "yolox_decoded": _yolov5,
    "end_to_end": _end_to_end,
    "rtdetr": _rtdetr,
    "rfdetr": _rtdetr,
    "detr": _detr,
    "detections": _detections,
}


def _grid(size: tuple[int, int], strides: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Return column and row of each cell, (n, 2), and its stride, (n,)."""
    cells, scale = [], []
    for stride in strides:
        x, y = np.meshgrid(np.arange(size[0] // stride), np.arange(size[1] // stride))
        cells.append(np.stack([x.ravel(), y.ravel()], axis=1))
        scale.append(np.full(x.size, float(stride)))
    return np.concatenate(cells).astype(np.float64), np.concatenate(scale)


def _corners(boxes: FloatArray) -> FloatArray:
    """Return x0 y0 x1 y1 of boxes cx cy w h, (n, 4)."""
    half = boxes[:, 2:4] / 2
    return np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)


def _in_pixels(boxes: FloatArray, size: tuple[int, int]) -> FloatArray:
    if len(boxes) and np.nanmax(np.abs(boxes)) <= LARGEST_SHARE:
        return boxes * np.tile(size, 2)
    return boxes


def _whole(values: FloatArray) -> npt.NDArray[np.intp]:
    """Return class numbers; -1, which is no class, for what is not one."""
    sound = np.isfinite(values) & (np.abs(values) < 1e6)
    return np.rint(np.where(sound, values, -1.0)).astype(np.intp)


def _sigmoid(values: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * values)))
