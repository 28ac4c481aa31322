"""What is written beside each box in the picture, and where, so that labels do not lie on others.

A view with more than five labels cuts each at its first line break. So there are none: a label is
wrapped at its spaces by the width of what it hangs from.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from dashboards.columns import BoolArray, CameraRows
from dashboards.style import Z_95
from pipeline.records import FloatArray, IntArray

# How large the picture is drawn in a window of 1920x1080; labels keep their size on the screen, so
# where they collide depends on it. At other sizes they only sit less well.
PANEL_PX = (1120.0, 600.0)
LINE_PX, CHARACTER_PX, MARGIN_PX = 15.0, 7.0, 8.0
LINES = 2
NO_BREAK = "\u00a0"  # a space at which a line may not end
ASSUMED = f" height{NO_BREAK}assumed"


def label_lines(rows: CameraRows) -> tuple[pa.Array, pa.Array]:
    """Return number and depth, and height, with 95 % intervals: the lines of each label, (n,)."""
    best = rows.best
    number = _joined("#", _text(rows.tracks.track_id[rows.observations.track]))
    depth = _joined(NO_BREAK, with_interval(best.depth_m, best.depth_std_m))
    height = _joined(f" ↕{NO_BREAK}", with_interval(best.height_m, best.height_std_m))
    first = _joined(number, pc.if_else(pa.array(np.isfinite(best.depth_m)), depth, ""))
    second = pc.if_else(pa.array(np.isfinite(best.height_m)), height, "")
    return first, pc.if_else(pa.array(best.height_assumed), pa.scalar(ASSUMED), second)


def with_interval(value_m: FloatArray, std_m: FloatArray) -> pa.Array:
    """Return `12.4 ± 0.9 m`, (n,): rounded to what the interval allows; no interval, no ±."""
    half_m = Z_95 * std_m
    texts = []
    for digits in (0, 1, 2):
        value = _joined(_decimal(value_m, digits), f"{NO_BREAK}m")
        between = _joined(_decimal(value_m, digits), f"{NO_BREAK}±{NO_BREAK}")
        both = _joined(_joined(between, _decimal(half_m, digits)), f"{NO_BREAK}m")
        texts.append(pc.if_else(pa.array(np.isfinite(half_m)), both, value))
    coarse, fine = pa.array(half_m >= 3), pa.array(half_m >= 0.3)
    return pc.if_else(coarse, texts[0], pc.if_else(fine, texts[1], texts[2]))


def _decimal(values: FloatArray, digits: int) -> pa.Array:
    """Return numbers, none negative, with a fixed count of decimals; what is unknown becomes 0."""
    scaled = np.rint(np.clip(np.nan_to_num(values), 0, 1e9) * 10**digits).astype(np.int64)
    whole = _text(scaled // 10**digits)
    if digits == 0:
        return whole
    part = pc.utf8_lpad(_text(scaled % 10**digits), digits, "0")
    return pc.binary_join_element_wise(whole, part, ".")


def _text(numbers: IntArray) -> pa.Array:
    return pa.array(numbers).cast(pa.string())


def _joined(left: pa.Array | str, right: pa.Array | str) -> pa.Array:
    return pc.binary_join_element_wise(left, right, "")


def placed_labels(rows: CameraRows) -> tuple[pa.Array, FloatArray, FloatArray]:
    """Return the text of each label, (n,), and the flat box under which it hangs.

    A label hangs below the feet. Where it would lie on that of somebody nearer it moves above the
    head; where it still does, only the number is left.

    Returns:
        Text; middle of the edge, (n, 2), and half its width, (n,), in pixels of the picture.
    """
    first, second = label_lines(rows)
    boxes, scale = rows.observations.bbox_xyxy_px, _scale(rows)
    longest = np.maximum(*(pc.utf8_length(line).to_numpy(False) for line in (first, second)))
    width = (longest * CHARACTER_PX + MARGIN_PX) / scale
    height = (LINES * LINE_PX + MARGIN_PX) / scale
    # What leaves the picture is cut off: a label stays inside, over its box if need be.
    right = rows.camera["width_px"] or np.inf
    middle = np.clip((boxes[:, 0] + boxes[:, 2]) / 2, width / 2, right - width / 2)
    lowest = (rows.camera["height_px"] or np.inf) - height
    below = np.column_stack([middle, np.minimum(boxes[:, 3], lowest)])
    above = np.column_stack([middle, boxes[:, 1] - height])
    # Nearer ones first: those keep their place, and stand lower in the picture.
    order = np.lexsort((-boxes[:, 3], rows.observations.row))
    row, spread = rows.observations.row[order], width[order]
    points = below[order]
    moved = _covered(points, row, spread, height)
    points[moved] = above[order][moved]
    short = _covered(points, row, spread, height) | (points[:, 1] < 0)
    points[short] = below[order][short]
    back = np.argsort(order)
    number = pc.list_element(pc.split_pattern(first, NO_BREAK), 0)
    texts = pc.if_else(pa.array(short[back]), number, _joined(first, second))
    return texts, points[back], width / 2


def _covered(points: FloatArray, row: IntArray, width: FloatArray, height: float) -> BoolArray:
    """Return which label lies on an earlier one of its frame; `row` ascends."""
    covered = np.zeros(len(points), dtype=np.bool_)
    for step in range(1, len(points)):
        same = row[step:] == row[:-step]
        if not same.any():
            break
        apart = np.abs(points[step:] - points[:-step])
        beside = apart[:, 0] >= (width[step:] + width[:-step]) / 2
        covered[step:] |= same & ~beside & (apart[:, 1] < height)
    return covered


def _scale(rows: CameraRows) -> float:
    """Return screen pixels a picture's pixel."""
    width_px, height_px = rows.camera["width_px"], rows.camera["height_px"]
    if not width_px or not height_px:
        return 1.0
    return min(PANEL_PX[0] / width_px, PANEL_PX[1] / height_px)
