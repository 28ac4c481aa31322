"""Tracks cut into tracklets: pieces of which it is sure that they are one object.

A tracker that looks at one frame after another may take one person for another where boxes overlap, where
somebody is not seen for a while, and where the place or the size jumps. There it is cut; `linking` joins
the pieces with all of the recording known.
"""

from __future__ import annotations

import numpy as np

from pipeline.core.arrays import BoolArray, FloatArray, IntArray

# Two boxes that share so much of their area (intersection over union) may hold each other's person.
OVERLAP = 0.3
GAP_S = 0.6  # not seen for so long, who comes back may be somebody else
# A foot's step from one frame to the next that is nobody's: a quarter of the height for the box's own
# errors (five of `kalman.FOOT_STD`), and twice the 0.8 body heights a second of a walker with margin.
JUMP, JUMP_PER_S = 0.25, 2.4
HEIGHT_JUMP = 0.3  # of the logarithm: half of a person has gone or come


def overlapping(frame: IntArray, bbox_xyxy_px: FloatArray, least: float = OVERLAP) -> BoolArray:
    """Return whether a box of the same frame shares `least` with each box, (n,).

    Rows are sorted by frame and left side, and compared with the next, the next but one, and so on.
    """
    order = np.lexsort((bbox_xyxy_px[:, 0], frame))
    of, box = frame[order], bbox_xyxy_px[order]
    size = (box[:, 2:] - box[:, :2]).prod(axis=1)
    found = np.zeros(len(of), dtype=np.bool_)
    one = np.arange(len(of))
    for step in range(1, len(of)):
        one = one[one < len(of) - step]
        one = one[of[one] == of[one + step]]
        if not len(one):
            break
        a, b = box[one], box[one + step]
        low, high = np.maximum(a[:, :2], b[:, :2]), np.minimum(a[:, 2:], b[:, 2:])
        shared = np.clip(high - low, 0.0, None).prod(axis=1)
        near = shared > least * (size[one] + size[one + step] - shared)
        found[one[near]] = found[one[near] + step] = True
    result = np.empty(len(of), dtype=np.bool_)
    result[order] = found
    return result


def cut(
    track: IntArray, time_s: FloatArray, bbox_xyxy_px: FloatArray, together: BoolArray
) -> IntArray:
    """Return the number of the tracklet of each box, (n,), from 0, in the order of the rows.

    Args:
        track: of each box; rows are in order of track, then time.
        time_s: when.
        bbox_xyxy_px: where, (n, 4).
        together: whether another box overlaps it: a tracklet is alone throughout, or never.
    """
    if not len(track):
        return np.empty(0, dtype=np.int64)
    box = bbox_xyxy_px
    tall = np.maximum(box[:, 3] - box[:, 1], 1e-6)
    apart_s = np.diff(time_s)
    step = np.hypot(np.diff(box[:, 0] + box[:, 2]) / 2, np.diff(box[:, 3])) / tall[1:]
    begins = np.ones(len(track), dtype=np.bool_)
    begins[1:] = (
        (np.diff(track) != 0)
        | (np.diff(together.astype(np.int8)) != 0)
        | (apart_s > GAP_S)
        | (step > JUMP + JUMP_PER_S * apart_s)
        | (np.abs(np.diff(np.log(tall))) > HEIGHT_JUMP)
    )
    return np.cumsum(begins) - 1
