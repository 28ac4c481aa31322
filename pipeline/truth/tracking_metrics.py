"""Detection and tracking accuracy: HOTA, CLEAR MOT and identity metrics, as counts that add up.

HOTA     Luiten et al. (2021), HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking,
         International Journal of Computer Vision 129:548-578
CLEAR    Bernardin and Stiefelhagen (2008), Evaluating Multiple Object Tracking Performance: The CLEAR
         MOT Metrics, EURASIP Journal on Image and Video Processing 2008:246309
Identity Ristani et al. (2016), Performance Measures and a Data Set for Multi-Target, Multi-Camera
         Tracking, ECCV Workshops

HOTA is that of TrackEval, the others are those of py-motmetrics; the tests hold them to four decimals.
Boxes are x0, y0, x1, y1 in pixels; overlap is intersection over union.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.core.arrays import BoolArray, FloatArray, IntArray

# The overlaps at which a box counts as found, over which HOTA is the mean (Luiten 2021, Eq. 9).
OVERLAPS = np.round(np.arange(1, 20) * 0.05, 2)
# The one at which MOTA, switches, fragments and IDF1 are told.
USUAL_OVERLAP = 0.5
_ROUNDING = float(np.finfo(float).eps)  # TrackEval's tolerance: an overlap of exactly 0.5 counts


@dataclass(frozen=True, slots=True)
class Labelled:
    """Boxes with identities over frames: a structure of n-long arrays."""

    frame: IntArray
    identity: IntArray
    bbox_xyxy_px: FloatArray  # (n, 4)

    def __len__(self) -> int:
        return len(self.frame)

    def take(self, rows: BoolArray | IntArray) -> Labelled:
        """Return the boxes at `rows`: positions, or a mask."""
        return Labelled(self.frame[rows], self.identity[rows], self.bbox_xyxy_px[rows])


@dataclass(frozen=True, slots=True)
class Counts:
    """Numbers that add up over recordings, at each of the overlaps, (19,) each, and at the usual one.

    `association` is the sum over true positives of the association accuracy A(c) of their pair of
    identities (Luiten 2021, Eq. 7), `localisation` that of their overlaps.
    """

    true_positives: IntArray
    misses: IntArray
    false_positives: IntArray
    association: FloatArray
    localisation: FloatArray
    clear_matches: int
    switches: int
    fragments: int
    identity_true_positives: int


@dataclass(frozen=True, slots=True)
class _Pairs:
    """The boxes of one frame in both sets, and how much each two of them overlap."""

    true_rows: IntArray
    found_rows: IntArray
    overlap: FloatArray  # (true, found)


def compare(true: Labelled, found: Labelled) -> Counts:
    """Return how well boxes and identities that were found agree with the true ones.

    Frames in which neither has a box do not matter. No identity may come twice in a frame.
    """
    true, found = _numbered(true), _numbered(found)
    frames = list(_frames(true, found))
    tp, association, localisation = _hota(true, found, frames)
    matches, switches, fragments = _clear(true, found, frames)
    return Counts(
        true_positives=tp,
        misses=len(true) - tp,
        false_positives=len(found) - tp,
        association=association,
        localisation=localisation,
        clear_matches=matches,
        switches=switches,
        fragments=fragments,
        identity_true_positives=_identity(true, found, frames),
    )


def hota(counts: Counts) -> tuple[float, float, float]:
    """Return HOTA, DetA and AssA, each the mean over the overlaps (Luiten 2021, Eqs. 8-12)."""
    every = counts.true_positives + counts.misses + counts.false_positives
    detection = counts.true_positives / np.maximum(every, 1)
    association = counts.association / np.maximum(counts.true_positives, 1)
    both = np.sqrt(detection * association)
    return float(both.mean()), float(detection.mean()), float(association.mean())


def mota(counts: Counts) -> float:
    """Return 1 - (misses + false positives + switches) / true boxes; NaN without any."""
    true, found = _sizes(counts)
    errors = true + found - 2 * counts.clear_matches + counts.switches
    return 1.0 - errors / true if true else float("nan")


def idf1(counts: Counts) -> float:
    """Return 2 IDTP / (true boxes + found boxes) (Ristani 2016, Eq. 11); NaN without any."""
    total = sum(_sizes(counts))
    return 2 * counts.identity_true_positives / total if total else float("nan")


def _sizes(counts: Counts) -> tuple[int, int]:
    tp = int(counts.true_positives[0])
    return tp + int(counts.misses[0]), tp + int(counts.false_positives[0])


def overlaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the intersection over union of each of a (n, 4) with each of b (m, 4), (n, m)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.clip(high - low, 0.0, None).prod(axis=2)
    sizes = [(box[:, 2:] - box[:, :2]).prod(axis=1) for box in (a, b)]
    union = sizes[0][:, None] + sizes[1][None, :] - shared
    return np.asarray(shared / np.where(union > 0, union, 1.0))


def _numbered(boxes: Labelled) -> Labelled:
    """Return boxes in order of frame, with identities from 0 without gaps."""
    order = np.argsort(boxes.frame, kind="stable")
    _, identity = np.unique(boxes.identity, return_inverse=True)
    return Labelled(boxes.frame[order], identity[order], boxes.bbox_xyxy_px[order])


def _frames(true: Labelled, found: Labelled) -> Iterator[_Pairs]:
    """Yield the frames in which either has a box, in order."""
    every = np.union1d(true.frame, found.frame)
    edges = [
        (np.searchsorted(s.frame, every), np.searchsorted(s.frame, every, side="right"))
        for s in (true, found)
    ]
    for a, b, c, d in zip(*edges[0], *edges[1], strict=True):
        rows, columns = np.arange(a, b), np.arange(c, d)
        overlap = overlaps(true.bbox_xyxy_px[a:b], found.bbox_xyxy_px[c:d])
        yield _Pairs(rows, columns, overlap)


def _hota(
    true: Labelled, found: Labelled, frames: list[_Pairs]
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return true positives, and sums of association and localisation accuracy, by overlap.

    Each frame has one assignment, by overlap times how well the two identities agree throughout; the
    overlap then decides which of its pairs count (Luiten 2021, section 5.3, as TrackEval does it).
    """
    count_true, count_found = np.bincount(true.identity), np.bincount(found.identity)
    shape = len(count_true), len(count_found)
    possible = np.zeros(shape)
    for f in frames:
        if f.overlap.size:
            sums = f.overlap.sum(axis=0)[None, :] + f.overlap.sum(axis=1)[:, None] - f.overlap
            share = np.where(sums > _ROUNDING, f.overlap / np.where(sums > 0, sums, 1.0), 0.0)
            both = np.ix_(true.identity[f.true_rows], found.identity[f.found_rows])
            possible[both] += share
    either = count_true[:, None] + count_found[None, :] - possible
    agreement = possible / np.where(either > 0, either, 1.0)
    pairs, overlap = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)]
    for f in frames:
        if f.overlap.size:
            a, b = true.identity[f.true_rows], found.identity[f.found_rows]
            rows, columns = linear_sum_assignment(-agreement[np.ix_(a, b)] * f.overlap)
            pairs.append(np.stack([a[rows], b[columns]], axis=1))
            overlap.append(f.overlap[rows, columns])
    return _at_overlaps(np.concatenate(pairs), np.concatenate(overlap), count_true, count_found)


def _at_overlaps(
    pairs: IntArray, overlap: FloatArray, count_true: IntArray, count_found: IntArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    tp = np.zeros(len(OVERLAPS), dtype=np.int64)
    association, localisation = np.zeros(len(OVERLAPS)), np.zeros(len(OVERLAPS))
    for i, least in enumerate(OVERLAPS):
        counted = overlap >= least - _ROUNDING
        together, times = np.unique(pairs[counted], axis=0, return_counts=True)
        either = count_true[together[:, 0]] + count_found[together[:, 1]] - times
        tp[i] = counted.sum()
        association[i] = (times * (times / np.maximum(either, 1))).sum()
        localisation[i] = overlap[counted].sum()
    return tp, association, localisation


def _clear(true: Labelled, found: Labelled, frames: list[_Pairs]) -> tuple[int, int, int]:
    """Return matches, switches and fragments at the usual overlap.

    A pair of the frame before stays one as long as it may; the others are assigned by overlap.
    """
    last: dict[int, int] = {}  # the identity that each true one was found as
    seen: dict[int, list[bool]] = {}  # whether each true one was found, over its frames
    matches = switches = 0
    for f in frames:
        ids_true = true.identity[f.true_rows].tolist()
        ids_found = found.identity[f.found_rows].tolist()
        allowed = f.overlap >= USUAL_OVERLAP
        pairs = _kept_pairs(ids_true, ids_found, allowed, last)
        free_true = [i for i in range(len(ids_true)) if i not in pairs]
        taken = set(pairs.values())
        free_found = [j for j in range(len(ids_found)) if j not in taken]
        for i, j in _assigned(f.overlap, allowed, free_true, free_found):
            pairs[i] = j
            switches += last.get(ids_true[i], ids_found[j]) != ids_found[j]
            last[ids_true[i]] = ids_found[j]
        matches += len(pairs)
        for i, name in enumerate(ids_true):
            seen.setdefault(name, []).append(i in pairs)
    fragments = sum(
        sum(before and not now for before, now in pairwise(was)) - (not was[-1])
        for was in seen.values()
        if any(was)
    )
    return matches, switches, fragments


def _kept_pairs(
    ids_true: list[int], ids_found: list[int], allowed: BoolArray, last: dict[int, int]
) -> dict[int, int]:
    place = {name: j for j, name in enumerate(ids_found)}
    pairs: dict[int, int] = {}
    taken: set[int] = set()
    for i, name in enumerate(ids_true):
        j = place.get(last.get(name, -1))
        if j is not None and j not in taken and allowed[i, j]:
            pairs[i] = j
            taken.add(j)
    return pairs


def _assigned(
    overlap: FloatArray, allowed: BoolArray, rows: list[int], columns: list[int]
) -> list[tuple[int, int]]:
    """Return as many allowed pairs as can be, of the largest overlap together."""
    if not rows or not columns:
        return []
    part = np.ix_(rows, columns)
    # A pair that is not allowed costs more than all that are: it is taken only where none is left.
    never = float(min(len(rows), len(columns)) + 1)
    chosen = linear_sum_assignment(np.where(allowed[part], 1.0 - overlap[part], never))
    return [
        (rows[a], columns[b]) for a, b in zip(*chosen, strict=True) if allowed[rows[a], columns[b]]
    ]


def _identity(true: Labelled, found: Labelled, frames: list[_Pairs]) -> int:
    """Return the most boxes that one assignment of identities to identities can explain."""
    together = np.zeros(
        (len(np.unique(true.identity)), len(np.unique(found.identity))), dtype=np.int64
    )
    for f in frames:
        i, j = np.nonzero(f.overlap >= USUAL_OVERLAP)
        np.add.at(together, (true.identity[f.true_rows[i]], found.identity[f.found_rows[j]]), 1)
    rows, columns = linear_sum_assignment(together, maximize=True)
    return int(together[rows, columns].sum())
