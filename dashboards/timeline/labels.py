"""Labels of the boxes in the picture: their text, and places at which they do not cover each other.

A view with more than five labels cuts each at its first line break. So there are none: a label is
wrapped at its spaces by the width of what it hangs from.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from dashboards.style import Z_95
from dashboards.timeline.columns import BoolArray, CameraRows
from pipeline.core.arrays import FloatArray, IntArray

LINE_PX, CHARACTER_PX, MARGIN_PX = 15.0, 7.0, 8.0
LINES = 2
GAP_PX = 4.0
# Of a crowd those that are nearest have labels that keep clear of all others.
MOST_PLACED = 32
FRAMES_AT_ONCE = 2048
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
    for digits in range(4):
        value = _joined(_decimal(value_m, digits), f"{NO_BREAK}m")
        between = _joined(_decimal(value_m, digits), f"{NO_BREAK}±{NO_BREAK}")
        both = _joined(_joined(between, _decimal(half_m, digits)), f"{NO_BREAK}m")
        texts.append(pc.if_else(pa.array(np.isfinite(half_m)), both, value))
    shown = pc.if_else(pa.array(half_m < 0.03), texts[3], texts[2])
    for digits, least_m in ((1, 0.3), (0, 3.0)):
        shown = pc.if_else(pa.array(half_m >= least_m), texts[digits], shown)
    return shown


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

    A label hangs below the feet, or above the head, or beside them: where it lies on no other label
    and on nobody else; nearer ones choose first. Where there is no such place it may lie on somebody,
    and where there is none even so only the number is left.

    Returns:
        Text; middle of the edge, (n, 2), and half its width, (n,), in pixels of the picture.
    """
    first, second = label_lines(rows)
    number = pc.list_element(pc.split_pattern(first, NO_BREAK), 0)
    scale = rows.screen_scale
    longest = np.maximum(*(pc.utf8_length(line).to_numpy(False) for line in (first, second)))
    width = (longest * CHARACTER_PX + MARGIN_PX) / scale
    short_width = (pc.utf8_length(number).to_numpy(False) * CHARACTER_PX + MARGIN_PX) / scale
    height, short_height = ((n * LINE_PX + MARGIN_PX) / scale for n in (LINES, 1))
    boxes = rows.observations.bbox_xyxy_px
    picture = (rows.camera["width_px"] or np.inf, rows.camera["height_px"] or np.inf)
    places = [
        *_places(boxes, width, height, picture, GAP_PX / scale),
        *_places(boxes, short_width, short_height, picture, GAP_PX / scale)[:2],
    ]
    chosen = np.zeros(len(boxes), dtype=np.int64)
    starts = rows.observations.starts(len(rows.frames))
    for begin in range(0, len(starts) - 1, FRAMES_AT_ONCE):
        at = starts[begin : begin + FRAMES_AT_ONCE + 1]
        part = slice(int(at[0]), int(at[-1]))
        chosen[part] = _chosen(
            rows.observations.row[part] - begin, boxes[part], [p[part] for p in places]
        )
    rectangle = np.stack(places)[chosen, np.arange(len(boxes))]
    short = chosen >= len(places) - 2
    texts = pc.if_else(pa.array(short), number, _joined(first, second))
    middle = np.column_stack([(rectangle[:, 0] + rectangle[:, 2]) / 2, rectangle[:, 1]])
    return texts, middle, np.where(short, short_width, width) / 2


def _places(
    boxes: FloatArray,
    width: FloatArray,
    height: float,
    picture: tuple[float, float],
    gap: float,
) -> list[FloatArray]:
    """Return where labels may lie, (n, 4) each: below, above, right, left; the best first.

    What leaves the picture is cut off: a label stays inside, over its box if need be.
    """
    x_min, y_min, x_max, y_max = boxes.T
    centred = (x_min + x_max - width) / 2
    corners = [
        (centred, y_max),
        (centred, y_min - height - gap),
        (x_max + gap, y_min),
        (x_min - width - gap, y_min),
    ]
    places = []
    for left, top in corners:
        inside_x = np.clip(left, 0.0, np.maximum(picture[0] - width, 0.0))
        inside_y = np.clip(top, 0.0, max(picture[1] - height, 0.0))
        places.append(np.column_stack([inside_x, inside_y, inside_x + width, inside_y + height]))
    return places


def _chosen(row: IntArray, boxes: FloatArray, places: list[FloatArray]) -> IntArray:
    """Return which place each label takes, (n,): one label of each frame at a time, all frames at once.

    Args:
        row: the frame of each, ascending, (n,).
        boxes: (n, 4).
        places: where each may lie, (n, 4) each, the best first; the last two are of short labels.
    """
    chosen = np.full(len(row), len(places) - 2, dtype=np.int64)
    if not len(row):
        return chosen
    order = np.lexsort((-boxes[:, 3], row))  # the nearest stand lowest in the picture
    rank = np.empty(len(row), dtype=np.int64)
    rank[order] = np.arange(len(row)) - np.searchsorted(row, row)
    crowd = min(int(rank.max()) + 1, MOST_PLACED)
    nowhere = np.full((int(row[-1]) + 1, crowd, 4), np.nan)  # overlaps nothing
    people, labels = nowhere.copy(), nowhere.copy()
    kept = rank < crowd
    people[row[kept], rank[kept]] = boxes[kept]
    for turn in range(crowd):
        mine = np.flatnonzero(rank == turn)
        others, placed = people[row[mine]], labels[row[mine]]
        others[:, turn] = np.nan  # a label may touch its own box
        on_labels = np.stack([_overlaps(p[mine], placed[:, :turn]) for p in places])
        on_people = np.stack([_overlaps(p[mine], others) for p in places])
        free, clear = ~on_labels, ~on_labels & ~on_people
        clear[-2:] = False  # a whole label over somebody is better than a number beside them
        best = np.where(
            clear.any(axis=0),
            clear.argmax(axis=0),
            np.where(free.any(axis=0), free.argmax(axis=0), len(places) - 2),
        )
        chosen[mine] = best
        labels[row[mine], turn] = np.stack([p[mine] for p in places])[best, np.arange(len(mine))]
    return chosen


def _overlaps(one: FloatArray, others: FloatArray) -> BoolArray:
    """Return which rectangles, (m, 4), overlap any of theirs, (m, k, 4)."""
    low = np.maximum(one[:, None, :2], others[:, :, :2])
    high = np.minimum(one[:, None, 2:], others[:, :, 2:])
    return np.asarray(np.any(np.all(low < high, axis=2), axis=1))
