"""Ground truth: stadimeter.GroundTruth."""

from __future__ import annotations

import math

from pipeline.core.arrays import NAN
from pipeline.core.records import TrueObject
from pipeline.messages.boxes import edges, is_box
from pipeline.messages.content import Decoded
from pipeline.messages.tree import Tree, child, children, frame_id_of, number, text, time_of

_SIZES = ("depth_m", "range_m", "height_m", "width_m")


def ground_truth(tree: Tree) -> Decoded:
    """Return the true objects of a frame; impossible values are left out one by one."""
    objects, refused = [], list[str]()
    for row in children(tree, "objects"):
        values = {name: number(row, name) for name in (*_SIZES, "x_m", "y_m")}
        for name in _SIZES:
            if name in row and not 0 < values[name] < math.inf:
                refused.append(f"true {name} {values[name]:g} is impossible")
                values[name] = NAN
        bbox = (NAN, NAN, NAN, NAN)
        if "box" in row:
            bbox = edges(child(row, "box"))
            if not is_box(bbox):
                refused.append(f"true box {bbox} is no box")
                bbox = (NAN, NAN, NAN, NAN)
        objects.append(
            TrueObject(text(row, "object_id"), text(row, "class_name"), bbox_xyxy_px=bbox, **values)
        )
    return Decoded(time_of(tree), frame_id_of(tree), tuple(objects), refused)
