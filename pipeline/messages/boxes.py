"""Boxes: stadimeter.Detections, foxglove.ImageAnnotations, vision_msgs/Detection2DArray.

Foxglove counts pixels from the upper left corner of the first one, and so do detectors; here its
centre is (0, 0), half a pixel less.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pipeline.core.arrays import NAN
from pipeline.core.records import Boxes
from pipeline.messages.content import Decoded
from pipeline.messages.tree import (
    Tree,
    as_number,
    child,
    children,
    frame_id_of,
    number,
    text,
    time_of,
    whole,
)

Edges = tuple[float, float, float, float]

# What a drawn box is worth when the detector does not say: half a pixel of rounding to each side,
# and a little more for the judgement of where an object ends.
RECORDED_BOX_STD_PX = 0.5
UNKNOWN_CLASS = "unknown"
_CORNER_PX = 0.5
# foxglove.PointsAnnotation.Type
_LINE_LOOP, _LINE_STRIP = 2, 3


class Box(NamedTuple):
    """One object as a message states it."""

    edges: Edges
    class_name: str
    score: float
    std_px: float
    object_id: str | None


def edges(box: Tree) -> Edges:
    """Return the edges of a stadimeter.BoundingBox; protobuf leaves out a zero."""
    x_min, y_min = number(box, "x_min_px", 0.0), number(box, "y_min_px", 0.0)
    return (x_min, y_min, number(box, "x_max_px", 0.0), number(box, "y_max_px", 0.0))


def is_box(box: Edges) -> bool:
    """Return whether edges are those of a box in a picture that can exist."""
    x_min, y_min, x_max, y_max = box
    return all(abs(e) < 1e6 for e in box) and x_min < x_max and y_min < y_max


def detections(tree: Tree) -> Decoded:
    """Return the boxes of a stadimeter.Detections."""
    found = []
    for row in children(tree, "objects"):
        std_px = number(row, "box_std_px")
        known = math.isfinite(std_px) and std_px >= 0
        found.append(
            Box(
                edges(child(row, "box")),
                text(row, "class_name") or UNKNOWN_CLASS,
                number(row, "score"),
                std_px if known else RECORDED_BOX_STD_PX,
                text(row, "object_id") if "object_id" in row else None,
            )
        )
    return _decoded(tree, found, time_of(tree), frame_id_of(tree))


def image_annotations(tree: Tree) -> Decoded:
    """Return the rectangles of a foxglove.ImageAnnotations, named by the texts at them."""
    found, time_ns = [], time_of(tree)
    texts = [(_point(child(t, "position")), text(t, "text")) for t in children(tree, "texts")]
    for row in children(tree, "points"):
        time_ns = time_ns or time_of(row)
        box = _rectangle([_point(p) for p in children(row, "points")], whole(row, "type"))
        if box is None:
            continue
        label = next((words for place, words in texts if _names(place, box)), "")
        stated = {text(m, "key"): text(m, "value") for m in children(row, "metadata")}
        found.append(
            Box(
                box,
                stated.get("class_name") or label or UNKNOWN_CLASS,
                as_number(stated.get("score")),
                RECORDED_BOX_STD_PX,
                stated.get("object_id"),
            )
        )
    if not found:  # other drawings are no statement on what is in the picture
        return Decoded(time_ns, frame_id_of(tree), None)
    return _decoded(tree, found, time_ns, frame_id_of(tree))


def detection_2d_array(tree: Tree) -> Decoded:
    """Return the boxes of a vision_msgs/Detection2DArray of any of its versions."""
    found = []
    for row in children(tree, "detections"):
        best = max(map(_hypothesis, children(row, "results")), default=("", NAN), key=_by_score)
        name = text(row, "tracking_id") or text(row, "id")
        found.append(
            Box(
                _centred(child(row, "bbox")),
                best[0] or UNKNOWN_CLASS,
                best[1],
                RECORDED_BOX_STD_PX,
                name or None,
            )
        )
    return _decoded(tree, found, time_of(tree), frame_id_of(tree))


def _point(tree: Tree) -> tuple[float, float]:
    return number(tree, "x", 0.0) - _CORNER_PX, number(tree, "y", 0.0) - _CORNER_PX


def _rectangle(points: list[tuple[float, float]], kind: int) -> Edges | None:
    """Return an upright rectangle drawn as a line; None for any other drawing."""
    if kind == _LINE_STRIP and len(points) == 5 and points[0] == points[-1]:
        points = points[:4]
    elif kind != _LINE_LOOP:
        return None
    if len(points) != 4 or not all(map(math.isfinite, (v for p in points for v in p))):
        return None
    x_values, y_values = zip(*points, strict=True)
    box = min(x_values), min(y_values), max(x_values), max(y_values)
    corners = {(x, y) for x in (box[0], box[2]) for y in (box[1], box[3])}
    return box if set(points) == corners else None


def _names(place: tuple[float, float], box: Edges) -> bool:
    """Return whether a text belongs to a box: it starts in it, or at its upper edge, within a line."""
    line_px = 24
    return box[0] - 2 <= place[0] <= box[2] and box[1] - line_px <= place[1] <= box[3] + line_px


def _centred(bbox: Tree) -> Edges:
    """Return the upright hull of a vision_msgs/BoundingBox2D.

    Its centre was a geometry_msgs/Pose2D up to version 3, and is a Pose2D with a point since.
    """
    centre = child(bbox, "center")
    point = child(centre, "position") or centre
    x, y = _point(point)
    width, height = number(bbox, "size_x"), number(bbox, "size_y")
    cos, sin = (abs(f(number(centre, "theta", 0.0))) for f in (math.cos, math.sin))
    half_x, half_y = (width * cos + height * sin) / 2, (width * sin + height * cos) / 2
    return x - half_x, y - half_y, x + half_x, y + half_y


def _hypothesis(result: Tree) -> tuple[str, float]:
    stated = child(result, "hypothesis") or result
    return text(stated, "class_id") or text(stated, "id"), number(stated, "score")


def _by_score(hypothesis: tuple[str, float]) -> float:
    return -math.inf if math.isnan(hypothesis[1]) else hypothesis[1]


def _decoded(tree: Tree, found: list[Box], time_ns: int | None, frame_id: str) -> Decoded:
    kept = [box for box in found if is_box(box.edges)]
    refused = [f"box {box.edges} is no box" for box in found if not is_box(box.edges)]
    std = np.array([box.std_px for box in kept], dtype=np.float64)
    payload = Boxes(
        bbox_xyxy_px=np.array([b.edges for b in kept], dtype=np.float64).reshape(-1, 4),
        score=np.array([b.score for b in kept], dtype=np.float64),
        class_name=tuple(b.class_name for b in kept),
        std_px=np.repeat(std[:, None], 4, axis=1),
        object_id=tuple(b.object_id for b in kept),
    )
    return Decoded(time_ns, frame_id, payload, refused)
