"""What comes out of a person detector's network, by family, as boxes with scores and classes.

    yolov5         (1, n, 5 + c)   cx cy w h objectness classes     YOLOv5, v6, v7
    yolov8         (1, 4 + c, n)   cx cy w h classes                YOLOv8, v9, v11, v12
    yolox          (1, n, 5 + c)   as yolov5, relative to a grid and its stride
    yolox_decoded  (1, n, 5 + c)   YOLOX exported with its decoding
    end_to_end     (1, n, 6)       x0 y0 x1 y1 score class          YOLOv10, YOLO26
    rtdetr         (1, n, c) and (1, n, 4), or (1, n, 4 + c)        RT-DETR, D-FINE, DEIM
    rfdetr         (1, n, c) and (1, n, 4)                          RF-DETR, Deformable DETR
    detr           (1, n, c + 1) and (1, n, 4)                      DETR; the last class is "nothing"
    detections     (1, n) labels, (1, n, 4) x0 y0 x1 y1, (1, n) scores   RT-DETR, torchvision

Families differ in how they want the picture, so that taking one for another gives boxes that look
right and are not. Where the shapes fit two, nothing is guessed: the user has to say which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray
from pipeline.core.errors import UnusableModel
from pipeline.detect.network.input import Fit, Normalisation

Array = npt.NDArray[np.generic]

UNIT = Normalisation()
IMAGENET = Normalisation(mean=(0.485, 0.456, 0.406), std=(0.229, 0.224, 0.225))
# The strides of the grids on which YOLO networks look for objects; large inputs add the last.
STRIDES = (8, 16, 32)
STRIDES_LARGE = (8, 16, 32, 64)
ANCHORS = 3  # boxes a cell in YOLOv5 and v7
# Boxes that reach less far than this cannot be in pixels: they are shares of the input's sides.
LARGEST_SHARE = 2.0
# Tasks whose networks give boxes with more values after the classes: masks, joints.
MORE_VALUES = ("segment", "pose")
MASK_VALUES, POSE_VALUES = 32, 51  # how many, where nothing says so


@dataclass(frozen=True, slots=True)
class Family:
    """How a family of networks takes a picture."""

    name: str
    fit: Fit = Fit.LETTERBOX
    normalisation: Normalisation = UNIT
    input_px: int = 640  # the usual side of the input, where the file leaves it open


FAMILIES = {
    family.name: family
    for family in (
        Family("yolov5"),
        Family("yolov8"),
        Family("yolox", Fit.CORNER, Normalisation(rgb=False, divisor=1.0)),
        Family("yolox_decoded", Fit.CORNER, Normalisation(rgb=False, divisor=1.0)),
        Family("end_to_end"),
        Family("rtdetr", Fit.STRETCH),
        Family("rfdetr", Fit.STRETCH, IMAGENET),
        Family("detr", Fit.STRETCH, IMAGENET, input_px=800),
        Family("detections", Fit.STRETCH),
    )
}


@dataclass(frozen=True, slots=True)
class Candidates:
    """Boxes as a network gives them, in pixels of its input counted from the outer edge."""

    bbox: FloatArray  # (n, 4) x0 y0 x1 y1
    score: FloatArray  # (n,)
    class_index: npt.NDArray[np.intp]  # (n,)

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.bool_]) -> Candidates:
        """Return those at `index`: positions, or a mask."""
        return Candidates(self.bbox[index], self.score[index], self.class_index[index])


def recognise(
    shapes: Sequence[tuple[int, ...]],
    size: tuple[int, int],
    class_count: int | None,
    metadata: dict[str, str] | None = None,
) -> str:
    """Return the family whose outputs have these shapes.

    Args:
        shapes: of the outputs, in the file's order, as the network gave them.
        size: width and height of the input.
        class_count: how many classes the file or the user names; None if neither does.
        metadata: of the file.

    Raises:
        UnusableModel: no family has such outputs, or two have.
    """
    # Masks and feature maps come beside boxes; they have more dimensions.
    flat = [s for s in _unbatched(shapes) if len(s) <= 2]
    if (metadata or {}).get("task") in ("obb", "classify", "semantic"):
        raise _unknown(shapes, f"the model is for another task, {(metadata or {})['task']!r}")
    if len(flat) == 3 and sorted(len(s) for s in flat) == [1, 1, 2]:
        return "detections"
    if len(flat) == 2 and all(len(s) == 2 for s in flat):
        return _transformer(shapes, flat, class_count)
    if len(flat) == 1 and len(flat[0]) == 2:
        return _single(shapes, flat[0], size, class_count)
    raise _unknown(shapes, "no known person detector has such outputs")


def _transformer(
    shapes: Sequence[tuple[int, ...]], flat: list[tuple[int, ...]], class_count: int | None
) -> str:
    """Tell the DETR family's members by the number of classes that each was published with."""
    sides = [s[1] for s in flat]
    if flat[0][0] != flat[1][0] or 4 not in sides:
        raise _unknown(shapes, "no known person detector has such outputs")
    classes = sides[1 - sides.index(4)]
    published = {80: "rtdetr", 91: "rfdetr", 92: "detr"}
    if classes in published and class_count in (None, classes, classes - 1):
        return published[classes]
    raise _ambiguous(shapes, ("rtdetr", "rfdetr", "detr"))


def _single(
    shapes: Sequence[tuple[int, ...]],
    shape: tuple[int, ...],
    size: tuple[int, int],
    class_count: int | None,
) -> str:
    rows, columns = shape
    cells = {_cell_count(size, STRIDES), _cell_count(size, STRIDES_LARGE)}
    if columns in cells and rows not in cells and rows >= 5:
        return "yolov8"
    if rows in {ANCHORS * n for n in cells} and columns >= 6:
        return "yolov5"
    if rows in cells:
        if columns == 4 + (class_count or 80):
            return "yolov8"
        if columns >= 6:
            raise _ambiguous(shapes, ("yolox", "yolox_decoded", "yolov5"))
    elif columns == 6 and class_count != 2:
        return "end_to_end"
    elif columns == 4 + (class_count or 80):
        if columns == 6:
            raise _ambiguous(shapes, ("end_to_end", "rtdetr"))
        return "rtdetr"
    raise _unknown(shapes, "no known person detector has such outputs")


def class_count_of(
    family: str,
    shapes: Sequence[tuple[int, ...]],
    size: tuple[int, int],
    named: int | None,
    metadata: dict[str, str],
) -> int | None:
    """Return how many classes a network tells apart; None where its outputs do not show it.

    Args:
        family: one of `FAMILIES`.
        shapes: of the outputs, as the network gave them.
        size: width and height of the input.
        named: how many classes the file or the user names; None if neither does.
        metadata: of the file.

    Raises:
        UnusableModel: another number of classes is named than there are.
    """
    if family in ("end_to_end", "detections"):
        return named
    unbatched = _unbatched(shapes)
    tables = [s for s in unbatched if len(s) == 2]
    if family == "detr" or (family in ("rtdetr", "rfdetr") and len(tables) == 2):
        sides = sorted(s[1] for s in tables)
        there = (sides[1] if sides[0] == 4 else sides[0]) - (family == "detr")
    elif family == "yolov8":
        cells = {_cell_count(size, STRIDES), _cell_count(size, STRIDES_LARGE)}
        there = (tables[0][0] if tables[0][1] in cells else tables[0][1]) - 4
    else:
        there = tables[0][1] - (4 if family == "rtdetr" else 5)
    masks = any(len(s) == 3 and s[0] == MASK_VALUES for s in unbatched)
    more = masks or metadata.get("task") in MORE_VALUES
    if named is not None and (named == there or (more and named < there)):
        return named
    # Fine-tuned transformers keep a place for class 0, or for none.
    if named is not None and family == "rfdetr" and named == there - 1:
        return there
    if named is not None:
        raise UnusableModel(
            f"the model tells {there} classes apart, but {named} are named",
            remedy="Name them all, in order, as model_classes in the table [detect]",
        )
    if masks and there > MASK_VALUES:
        return there - MASK_VALUES
    return 1 if family == "yolov8" and there == 1 + POSE_VALUES else there


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
    arrays = [o.reshape(s) for o, s in zip(outputs, _unbatched(shapes), strict=True)]
    flat: list[Any] = [
        a if a.dtype.kind in "iu" else a.astype(np.float64) for a in arrays if a.ndim <= 2
    ]
    try:
        found = _DECODERS[family](flat, size, class_count)
    except (_UnfitError, IndexError, ValueError) as error:
        raise _unknown(shapes, f"the outputs are not those of the family {family!r}") from error
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
    strides = next((s for s in (STRIDES, STRIDES_LARGE) if _cell_count(size, s) == len(table)), ())
    if not strides:
        raise _UnfitError
    grid, stride = _grid(size, strides)
    table[:, :2] = (table[:, :2] + grid) * stride[:, None]
    with np.errstate(over="ignore"):
        table[:, 2:4] = np.exp(table[:, 2:4]) * stride[:, None]
    return _yolov5([table], size, class_count)


def _yolov8(flat: list[FloatArray], size: tuple[int, int], class_count: int | None) -> Candidates:
    table = _one(flat, 5)
    cells = {_cell_count(size, STRIDES), _cell_count(size, STRIDES_LARGE)}
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


def suppress(found: Candidates, limit: float) -> Candidates:
    """Return what is left when of boxes of one class that share more than `limit` the best stays.

    Greedy non-maximum suppression; what two boxes share is their intersection over their union.
    """
    found = found.take(np.argsort(-found.score, kind="stable"))
    overlap = overlap_of(found.bbox, found.bbox)
    same = found.class_index[:, None] == found.class_index
    rivals = (overlap > limit) & same
    kept = np.ones(len(found.score), dtype=bool)
    for best in range(len(kept)):
        if kept[best]:
            kept[best + 1 :] &= ~rivals[best, best + 1 :]
    return found.take(kept)


def overlap_of(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the intersection over union of boxes (n, 4) and (m, 4), (n, m)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=2)
    area_a, area_b = ((x[:, 2:] - x[:, :2]).prod(axis=1) for x in (a, b))
    union = area_a[:, None] + area_b - shared
    return np.asarray(shared / np.maximum(union, 1e-12))


def _cell_count(size: tuple[int, int], strides: Sequence[int]) -> int:
    return sum((size[0] // s) * (size[1] // s) for s in strides)


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


def _unbatched(shapes: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return shapes without the batch's dimension: boxes are tables, a third dimension is it."""
    if any(len(s) >= 3 for s in shapes):
        return [s[1:] if len(s) > 1 and s[0] == 1 else s for s in shapes]
    return [tuple(s) for s in shapes]


def _say(shapes: Sequence[tuple[int, ...]]) -> str:
    return ", ".join(str(tuple(s)) for s in shapes)


def _unknown(shapes: Sequence[tuple[int, ...]], why: str) -> UnusableModel:
    return UnusableModel(
        f"{why}; its outputs are {_say(shapes)}",
        remedy=f"Known families are {', '.join(FAMILIES)}; name one with --model-family if the "
        "model is of it",
    )


def _ambiguous(shapes: Sequence[tuple[int, ...]], names: Sequence[str]) -> UnusableModel:
    return UnusableModel(
        f"outputs of {_say(shapes)} can be those of {' or '.join(names)}, which want the picture "
        "in different forms",
        remedy=f"Say which with --model-family {'|'.join(names)}",
    )
