"""Check of what a message states: each impossible value is left out, and told.

This comes after decoding, so it holds for every encoding. The bounds refuse the impossible, not the
unusual; those of exposure are in `pipeline.core.exposure`, those of the lens in
`pipeline.messages.lens_readings`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.core.arrays import NAN
from pipeline.core.records import Boxes, TrueObject
from pipeline.mcap_file.reader import MAX_TIME_NS
from pipeline.messages.content import Decoded, Payload

# Farther than this nothing can be seen on the ground; nothing that is taller stands there.
LONGEST_M = 1e6
WIDEST_STD_PX = 1e4
# A box of less than this cannot be seen; in shares of a picture all boxes end at 1, but for rounding.
SHARE_ENDS_PX = 1.5
IN_SHARES = (
    "the boxes are in shares of the picture (0 to 1), not in pixels: they are not used; multiply them by "
    "the picture's width and height"
)


def refuse_implausible(message: Decoded) -> Decoded:
    """Return a message without its impossible values, and a sentence for each in `refused`."""
    refused: list[str] = []
    time_ns = message.capture_time_ns
    if time_ns is not None and not 0 < time_ns <= MAX_TIME_NS:
        refused.append(f"the time {time_ns / 1e9:.9g} s is impossible; the log time is used")
        time_ns = None
    payload = _plausible(message.payload, refused)
    if isinstance(payload, Boxes) and _in_shares(payload):
        kept = [*message.refused, *refused, IN_SHARES]
        return replace(
            message,
            capture_time_ns=time_ns,
            payload=Boxes.empty(),
            refused=kept,
            code="boxes_not_in_pixels",
        )
    if not refused:
        return message
    kept = message.refused + refused
    return replace(message, capture_time_ns=time_ns, payload=payload, refused=kept)


def _plausible(payload: Payload | None, refused: list[str]) -> Payload | None:
    if isinstance(payload, Boxes):
        return _boxes(payload, refused)
    if isinstance(payload, tuple):
        return tuple(  # type: ignore[return-value]
            _true_object(item, refused) if isinstance(item, TrueObject) else item
            for item in payload
        )
    return payload


def _boxes(boxes: Boxes, refused: list[str]) -> Boxes:
    with np.errstate(invalid="ignore"):
        bad_score = ~np.isnan(boxes.score) & ~((boxes.score >= 0) & (boxes.score <= 1))
        bad_std = ~((boxes.std_px >= 0) & (boxes.std_px <= WIDEST_STD_PX)).all(axis=1)
    if not bad_score.any() and not bad_std.any():
        return boxes
    refused += [f"score {value:g} is not between 0 and 1" for value in boxes.score[bad_score]]
    refused += [f"box of deviation {row.max():g} px is none" for row in boxes.std_px[bad_std]]
    return replace(boxes, score=np.where(bad_score, NAN, boxes.score)).take(
        np.flatnonzero(~bad_std)
    )


def _in_shares(boxes: Boxes) -> bool:
    """Return whether boxes are in shares of the picture: all of them lie in its first pixel."""
    return len(boxes) > 0 and bool((np.abs(boxes.bbox_xyxy_px) <= SHARE_ENDS_PX).all())


def _true_object(truth: TrueObject, refused: list[str]) -> TrueObject:
    absurd: dict[str, Any] = {}
    for name in ("depth_m", "range_m", "height_m", "width_m", "x_m", "y_m"):
        value = getattr(truth, name)
        if abs(value) > LONGEST_M:
            refused.append(f"true {name} {value:g} is impossible")
            absurd[name] = NAN
    return replace(truth, **absurd) if absurd else truth


def inside_picture(
    boxes: Boxes, width_px: int, height_px: int
) -> tuple[Boxes, list[tuple[float, ...]]]:
    """Return the boxes that show something of a picture, and the edges of those that do not."""
    x0, y0, x1, y1 = boxes.bbox_xyxy_px.T
    shown = (x1 > -0.5) & (y1 > -0.5) & (x0 < width_px - 0.5) & (y0 < height_px - 0.5)
    if shown.all():
        return boxes, []
    return boxes.take(shown), [tuple(row) for row in boxes.bbox_xyxy_px[~shown].tolist()]
