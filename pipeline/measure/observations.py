"""Rows of the table `observations`: every object in every frame, as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline.core.arrays import NAN, BoolArray, FloatArray, IntArray
from pipeline.core.records import Boxes, Frame
from pipeline.core.tables import OBSERVED
from pipeline.images.decode import Picture, relative_luminance_of
from pipeline.measure.appearance import packed
from pipeline.measure.blur.widths import Blur

# A box that comes within this of the picture's edge, in pixels in which the detector works, is cut.
EDGE_PX = 1.5
# A recorded box that goes on for more than that beyond the edge is of all of an object.
BEYOND_PX = 1.0
# Brightness inside a box is the mean over at most this many pixels in each direction.
SAMPLES_ACROSS = 12
_GRID = (np.arange(SAMPLES_ACROSS) + 0.5) / SAMPLES_ACROSS
_NO_PIXELS = np.empty((0, 0, 3), dtype=np.uint8)


class Seen(NamedTuple):
    """One frame with what was found in it."""

    frame: Frame
    picture: Picture | None
    boxes: Boxes
    track_ids: IntArray
    luminance: FloatArray  # of each box, (n,)
    colours: FloatArray | None = None  # of each box, (n, c), as `appearance.colours`
    confirmed: FloatArray | None = None  # of each box, (n,): 1 or 0 by a network, NaN: none looked

    def without_pixels(self) -> Seen:
        """Return the same without the bytes and the pixels of the picture, which are large."""
        frame = replace(self.frame, image=b"")
        if self.picture is None:
            return self._replace(frame=frame)
        return self._replace(frame=frame, picture=replace(self.picture, bgr=_NO_PIXELS, soft=None))


def observe(
    seen: Sequence[Seen],
    detectors: Mapping[str, str],
    first_index: int,
    blurs: Sequence[Blur] | None = None,
) -> pa.Table:
    """Return the observations of a batch of frames in the schema of the part `observations`.

    Args:
        seen: frames with boxes and track ids.
        detectors: the detector's name by camera.
        first_index: the number of the first observation.
        blurs: how blurred the boxes of each frame are, where anybody looked.
    """
    with_boxes = [s for s in seen if len(s.boxes)]
    if not with_boxes:
        return OBSERVED.empty_table()
    counts = np.array([len(s.boxes) for s in with_boxes])
    bbox = np.concatenate([s.boxes.bbox_xyxy_px for s in with_boxes])
    std = np.concatenate([s.boxes.std_px for s in with_boxes])
    size = np.array([_size(s.picture) for s in with_boxes], dtype=np.float64)
    recorded = np.repeat([detectors[s.frame.camera] == "recorded" for s in with_boxes], counts)
    cut = _truncated(bbox, np.repeat(size, counts, axis=0), recorded)
    total = int(counts.sum())
    columns: dict[str, object] = {
        "observation_index": np.arange(first_index, first_index + total),
        "camera": _spread([s.frame.camera for s in with_boxes], counts),
        "frame_index": np.repeat([s.frame.frame_index for s in with_boxes], counts),
        "track_id": np.concatenate([s.track_ids for s in with_boxes]),
        "object_id": [o for s in with_boxes for o in s.boxes.object_id],
        "class_name": [c for s in with_boxes for c in s.boxes.class_name],
        "detector": _spread([detectors[s.frame.camera] for s in with_boxes], counts),
        "score": np.concatenate([s.boxes.score for s in with_boxes]),
        "occlusion": np.concatenate([_occlusion(s.boxes.bbox_xyxy_px) for s in with_boxes]),
        "luminance": np.concatenate([s.luminance for s in with_boxes]),
        "measured": np.ones(total, dtype=np.bool_),
        "confirmed": [c for s in with_boxes for c in _confirmed(s)],
        "colours": [c for s in with_boxes for c in _packed(s)],
    }
    columns |= _blur(blurs, total)
    for side, name in enumerate(("x_min", "y_min", "x_max", "y_max")):
        columns[f"{name}_px"] = columns[f"raw_{name}_px"] = bbox[:, side]
        columns[f"{name}_std_px"] = std[:, side]
    for side, name in enumerate(("left", "top", "right", "bottom")):
        columns[f"truncated_{name}"] = cut[:, side]
    arrays = [pa.array(columns[f.name], type=f.type, from_pandas=True) for f in OBSERVED]
    return pa.Table.from_arrays(arrays, schema=OBSERVED)


def _confirmed(seen: Seen) -> list[bool | None]:
    if seen.confirmed is None:
        return [None] * len(seen.boxes)
    return [None if np.isnan(c) else bool(c) for c in seen.confirmed]


def _packed(seen: Seen) -> list[bytes | None]:
    return [None] * len(seen.boxes) if seen.colours is None else packed(seen.colours)


def _size(picture: Picture | None) -> tuple[float, float, float]:
    if picture is None:
        return NAN, NAN, 1.0
    return picture.width_px, picture.height_px, picture.reduction


def _truncated(bbox: FloatArray, size: FloatArray, recorded: BoolArray) -> BoolArray:
    """Return whether the picture's edge cuts off each side, (n, 4).

    A recorded box that goes on beyond the edge is a statement about all of the object. One that ends
    there was cut: the edge is the middle of the last pixel or its outer side, as its author counts.

    Args:
        bbox: the boxes, (n, 4).
        size: width and height of their pictures and how much those were reduced, (n, 3).
        recorded: which boxes are the recording's own, in pixels of the stored picture, (n,).
    """
    width, height, reduction = size.T
    reach = EDGE_PX * np.where(recorded, 1.0, reduction)[:, None]
    x0, y0, x1, y1 = bbox.T
    inside = np.stack([x0 + 0.5, y0 + 0.5, width - 0.5 - x1, height - 0.5 - y1], axis=1)
    beyond = recorded[:, None] & (inside < -BEYOND_PX)
    return np.asarray((inside < reach) & ~beyond)


def _occlusion(bbox: FloatArray) -> FloatArray:
    """Return the share of each box that the boxes of nearer objects cover, at most.

    On the ground, nearer is lower in the picture. Where several cover a box their shares add up, to
    no more than 1.
    """
    if len(bbox) == 1:
        return np.zeros(1)
    x0, y0, x1, y1 = bbox.T
    wide = np.minimum(x1[:, None], x1) - np.maximum(x0[:, None], x0)
    tall = np.minimum(y1[:, None], y1) - np.maximum(y0[:, None], y0)
    shared = np.clip(wide, 0, None) * np.clip(tall, 0, None)
    nearer = y1[None, :] > y1[:, None]
    covered = (shared * nearer).sum(axis=1) / ((x1 - x0) * (y1 - y0))
    return np.asarray(np.minimum(covered, 1.0))


def seen_whole(picture: Picture, boxes: Boxes) -> BoolArray:
    """Return whether the picture's edge cuts no side of each box that a detector found, (n,)."""
    size = np.broadcast_to(np.array(_size(picture), dtype=np.float64), (len(boxes), 3))
    cut = _truncated(boxes.bbox_xyxy_px, size, np.zeros(len(boxes), dtype=np.bool_))
    return np.asarray(~cut.any(axis=1))


def luminance_inside(picture: Picture | None, boxes: Boxes) -> FloatArray:
    """Return the mean relative luminance inside each box, sampled on a grid of the picture."""
    if picture is None or not len(boxes):
        return np.full(len(boxes), NAN)
    height, width = picture.bgr.shape[:2]
    ends = (boxes.bbox_xyxy_px + 0.5) / picture.reduction - 0.5
    low, high = ends.reshape(-1, 2, 2, 1).swapaxes(0, 1)  # (n, 2, 1) each: x and y
    at = np.rint(low + _GRID * (high - low))
    column, row = np.clip(at, 0, [[width - 1], [height - 1]]).astype(np.intp).swapaxes(0, 1)
    place = row[:, :, None] * width + column[:, None, :]
    pixels = picture.bgr.reshape(-1, 3).take(place.reshape(len(boxes), -1), axis=0)
    return np.asarray(relative_luminance_of(pixels).mean(axis=1))


def _blur(blurs: Sequence[Blur] | None, count: int) -> dict[str, object]:
    if blurs is None:
        unknown = np.full(count, NAN)
        none = [None] * count
        return {
            "blur_sigma_px": unknown,
            "blur_std_px": unknown,
            "blur_edge_count": none,
            "blur_reason": none,
        }
    reasons = [reason for b in blurs for reason in b.reason]
    edges = [int(n) if n else None for b in blurs for n in b.edge_count]
    return {
        "blur_sigma_px": np.concatenate([b.sigma_px for b in blurs]),
        "blur_std_px": np.concatenate([b.std_px for b in blurs]),
        "blur_edge_count": edges,
        "blur_reason": reasons,
    }


def _spread(names: list[str], counts: np.ndarray) -> list[str]:
    return [name for name, count in zip(names, counts, strict=True) for _ in range(count)]
