"""Non-maximum suppression: of boxes that share much, the best stays."""

from __future__ import annotations

import numpy as np

from pipeline.core.arrays import FloatArray
from pipeline.detect.network.output import Candidates


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
