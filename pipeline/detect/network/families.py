"""Families of detection networks: recognised by their outputs' shapes, with what each wants as input.

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
right and are not. Where shapes fit several, the values for one picture tell (`_by_values`); where these
do not tell either, nothing is guessed: the user has to say which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.core.errors import UnusableModel
from pipeline.detect.network.input import Fit, Normalisation

UNIT = Normalisation()
IMAGENET = Normalisation(mean=(0.485, 0.456, 0.406), std=(0.229, 0.224, 0.225))
# The strides of the grids on which YOLO networks look for objects; large inputs add the last.
STRIDES = (8, 16, 32)
STRIDES_LARGE = (8, 16, 32, 64)
ANCHORS = 3  # boxes a cell in YOLOv5 and v7
# Tasks whose networks give boxes with more values after the classes: masks, joints.
MORE_VALUES = ("segment", "pose")
# A box belongs to the cell in which its middle lies, or to one beside it: in the median it is nearer than
# so many strides. Pixels of a picture of ten cells or more are far more than that.
NEAR_CELL = 2.0
MASK_VALUES, POSE_VALUES = 32, 51  # how many, where nothing says so


@dataclass(frozen=True, slots=True)
class Family:
    """Conventions of a family of networks: its input and its decoder."""

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


def recognise(
    shapes: Sequence[tuple[int, ...]],
    size: tuple[int, int],
    class_count: int | None,
    metadata: dict[str, str] | None = None,
    outputs: Sequence[FloatArray] = (),
) -> str:
    """Return the family whose outputs have these shapes, and these values.

    Args:
        shapes: of the outputs, in the file's order, as the network gave them.
        size: width and height of the input.
        class_count: how many classes the file or the user names; None if neither does.
        metadata: of the file.
        outputs: values for any picture, in the file's order; none if they are not known.

    Raises:
        UnusableModel: no family has such outputs, or two have.
    """
    # Masks and feature maps come beside boxes; they have more dimensions.
    flat = [s for s in unbatched(shapes) if len(s) <= 2]
    if (metadata or {}).get("task") in ("obb", "classify", "semantic"):
        raise unknown_outputs(
            shapes, f"the model is for another task, {(metadata or {})['task']!r}"
        )
    if len(flat) == 3 and sorted(len(s) for s in flat) == [1, 1, 2]:
        return "detections"
    if len(flat) == 2 and all(len(s) == 2 for s in flat):
        return _transformer(shapes, flat, class_count)
    if len(flat) == 1 and len(flat[0]) == 2:
        return _single(shapes, flat[0], size, class_count, outputs)
    raise unknown_outputs(shapes, "no known person detector has such outputs")


def _transformer(
    shapes: Sequence[tuple[int, ...]], flat: list[tuple[int, ...]], class_count: int | None
) -> str:
    """Tell the DETR family's members by the number of classes that each was published with."""
    sides = [s[1] for s in flat]
    if flat[0][0] != flat[1][0] or 4 not in sides:
        raise unknown_outputs(shapes, "no known person detector has such outputs")
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
    outputs: Sequence[FloatArray],
) -> str:
    rows, columns = shape
    cells = {cell_count(size, STRIDES), cell_count(size, STRIDES_LARGE)}
    if columns in cells and rows not in cells and rows >= 5:
        return "yolov8"
    if rows in {ANCHORS * n for n in cells} and columns >= 6:
        return "yolov5"
    if rows in cells:
        if columns == 4 + (class_count or 80):
            return "yolov8"
        if columns >= 6:
            for values in outputs:
                found = (
                    _by_values(values.reshape(values.shape[-2:]), size) if values.ndim > 1 else ""
                )
                if found:
                    return found
            raise _ambiguous(shapes, ("yolox", "yolox_decoded", "yolov5"))
    elif columns == 6 and class_count != 2:
        return "end_to_end"
    elif columns == 4 + (class_count or 80):
        if columns == 6:
            raise _ambiguous(shapes, ("end_to_end", "rtdetr"))
        return "rtdetr"
    raise unknown_outputs(shapes, "no known person detector has such outputs")


def _by_values(table: FloatArray, size: tuple[int, int]) -> str:
    """Return the family of one box a cell, cx cy w h objectness classes, by its values; empty if unsure.

    Boxes that are decoded lie near their cells, in pixels; those that are not are offsets from the cell
    in strides, so that they do not follow the cells over the picture (Ge 2021, YOLOX: Exceeding YOLO
    Series in 2021). YOLOv6 has no objectness and exports it as 1 throughout.
    """
    strides = STRIDES if len(table) == cell_count(size, STRIDES) else STRIDES_LARGE
    x, y = (table[:, i].astype(np.float64) for i in range(2))
    cell_x, cell_y, stride = cells(size, strides).T
    if not (np.isfinite(x).all() and np.isfinite(y).all()) or (np.ptp(x) == 0 and np.ptp(y) == 0):
        return ""
    far = [np.median(np.abs(a - b) / stride) for a, b in ((x, cell_x), (y, cell_y))]
    if max(far) < NEAR_CELL:
        return "yolov5" if (table[:, 4] == 1).all() else "yolox_decoded"
    if max(np.median(np.abs(x)), np.median(np.abs(y))) < NEAR_CELL:
        return "yolox"
    return ""


def cells(size: tuple[int, int], strides: Sequence[int]) -> FloatArray:
    """Return centre in pixels and stride of each cell of the grids over an input, (n, 3)."""
    grids = []
    for stride in strides:
        x, y = np.meshgrid(np.arange(size[0] // stride), np.arange(size[1] // stride))
        centre = (np.stack([x.ravel(), y.ravel()], axis=1) + 0.5) * stride
        grids.append(np.column_stack([centre, np.full(x.size, float(stride))]))
    return np.concatenate(grids)


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
    bare = unbatched(shapes)
    tables = [s for s in bare if len(s) == 2]
    if family == "detr" or (family in ("rtdetr", "rfdetr") and len(tables) == 2):
        sides = sorted(s[1] for s in tables)
        there = (sides[1] if sides[0] == 4 else sides[0]) - (family == "detr")
    elif family == "yolov8":
        cells = {cell_count(size, STRIDES), cell_count(size, STRIDES_LARGE)}
        there = (tables[0][0] if tables[0][1] in cells else tables[0][1]) - 4
    else:
        there = tables[0][1] - (4 if family == "rtdetr" else 5)
    masks = any(len(s) == 3 and s[0] == MASK_VALUES for s in bare)
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


def cell_count(size: tuple[int, int], strides: Sequence[int]) -> int:
    """Return the number of cells of the grids of these strides over an input (width, height)."""
    return sum((size[0] // s) * (size[1] // s) for s in strides)


def unbatched(shapes: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return shapes without the batch's dimension: boxes are tables, a third dimension is it."""
    if any(len(s) >= 3 for s in shapes):
        return [s[1:] if len(s) > 1 and s[0] == 1 else s for s in shapes]
    return [tuple(s) for s in shapes]


def _say(shapes: Sequence[tuple[int, ...]]) -> str:
    return ", ".join(str(tuple(s)) for s in shapes)


def unknown_outputs(shapes: Sequence[tuple[int, ...]], why: str) -> UnusableModel:
    """Return the error for outputs of these shapes that no family, or not the named one, has."""
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
