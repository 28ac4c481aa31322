"""Blur of an object from its edges: one number, its deviation, or the reason for none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.arrays import NAN, FloatArray
from pipeline.core.config import Config
from pipeline.core.errors import UndecodableImage
from pipeline.core.lens import Lens
from pipeline.core.records import Boxes
from pipeline.images.decode import Image, Picture
from pipeline.measure.blur.edge_spread import Widths, widths_of
from pipeline.measure.blur.edges import CELL_PX, MAX_LEVELS, MIN_SIDE_PX, REACH_PX, edges_of
from pipeline.measure.blur.expected import Declined, floor_of, known, resolvable

# An object's outlines blur into each other where it is narrower than two blur circles and a half.
MIN_SIDE_IN_SIGMA = 10.0
# The largest of a frame are measured, each in some 20-40 ms: a crowd must not stop the reading.
MAX_BOXES = 30
# Edges that together are shorter than a tenth of the box's outline may be anything. Where the blur
# circle is not small beside the object it must be near half of it: a disc shows detail finer than itself
# as edges narrower than its own, but few, while the outline stays. On 300 random scenes the widths of
# objects with less were too small by 25-80 % in 11 of 15 cases, with more in 3 of 70, and those had
# wide intervals.
MIN_LENGTH_OF_OUTLINE, MIN_LENGTH_WHERE_WIDE = 0.1, 0.45
WIDE_SIDE_IN_SIGMA = 25.0
# The error of what is near an edge in sigmas, corners and shades: this over the object's side in sigmas.
NEARNESS = 0.25
MIN_EDGES = 4
# Edges near each other err alike: their common error is seen between cells of the box, 4 x 4.
CELLS = 4
# An edge's error beyond its fit's: what is left of neighbours, texture and shading.
EDGE_SCATTER, CRAMPED_SCATTER = 0.03, 0.06
# The error that all edges share. The form of the blur is not quite a disc and a Gaussian: interpolated
# colours, JPEG, and pictures that are not sampled finely enough. `python -m bench.defocus` shows it.
FORM_STD = 0.006
# Motion makes edges across it softer. Where the variance changes by this share with the direction of
# the edge, and by so many times its error, it is said to be motion (or astigmatism), and not blur.
MOTION_SHARE, MOTION_Z = 0.15, 3.0


@dataclass(frozen=True, slots=True)
class Blur:
    """The blur of the boxes of one frame: arrays of length n; NaN is unknown."""

    sigma_px: FloatArray  # standard deviation of a step's spread, stored pixels
    std_px: FloatArray
    edge_count: np.ndarray
    reason: tuple[Declined | None, ...]

    @staticmethod
    def declined(reasons: list[Declined]) -> Blur:
        """Return no blur, for reasons."""
        n = len(reasons)
        return Blur(np.full(n, NAN), np.full(n, NAN), np.zeros(n, dtype=np.int64), tuple(reasons))


def expected(boxes: Boxes, lens: Lens, config: Config, camera: str) -> np.ndarray:
    """Return which boxes are worth measuring, (n,); none where the lens is not known."""
    if not len(boxes) or not known(lens):
        return np.zeros(len(boxes), dtype=np.bool_)
    box = boxes.bbox_xyxy_px
    with np.errstate(invalid="ignore"):
        side = np.minimum(box[:, 2] - box[:, 0], box[:, 3] - box[:, 1])
    rows = np.flatnonzero(np.isfinite(box).all(axis=1) & (side >= MIN_SIDE_PX))
    names = tuple(boxes.class_name[i] for i in rows)
    worth = np.zeros(len(boxes), dtype=np.bool_)
    worth[rows] = resolvable(box[rows], names, lens, config, camera)
    return worth


def measure_frame(
    picture: Picture | None,
    boxes: Boxes,
    worth: np.ndarray,
    lens: Lens,
    config: Config,
    camera: str,
    decode_whole: Callable[[], Picture],
) -> Blur:
    """Measure the boxes that are worth it, in the picture at its stored size, decoded if need be."""
    if picture is None:
        return Blur.declined([Declined.NO_PICTURE] * len(boxes))
    if picture.reduction > 1:
        try:
            picture = decode_whole()
        except UndecodableImage:  # its reduced form was not: a part of it is damaged
            return Blur.declined([Declined.NO_PICTURE] * len(boxes))
    return measure(picture.bgr, boxes, worth, lens, config, camera)


def unmeasured(count: int, lens: Lens) -> Blur:
    """Return what is said of boxes that were not worth measuring."""
    why = Declined.UNRESOLVABLE if known(lens) else Declined.LENS_UNKNOWN
    return Blur.declined([why] * count)


def measure(
    bgr: Image, boxes: Boxes, worth: np.ndarray, lens: Lens, config: Config, camera: str
) -> Blur:
    """Measure the boxes that are worth it in a picture at its stored size."""
    blur = unmeasured(len(boxes), lens)
    reasons = list(blur.reason)
    floor_px, _ = floor_of(lens, config.camera_named(camera))
    aspect = math.sqrt(lens.pixel_pitch_x_um / lens.pixel_pitch_y_um)
    chosen = np.flatnonzero(worth)
    if len(chosen) > MAX_BOXES:
        area = np.prod(boxes.bbox_xyxy_px[chosen, 2:] - boxes.bbox_xyxy_px[chosen, :2], axis=1)
        by_size = np.argsort(-area, kind="stable")
        for i in chosen[by_size[MAX_BOXES:]]:
            reasons[i] = Declined.TOO_MANY
        chosen = chosen[by_size[:MAX_BOXES]]
    for i in map(int, chosen):
        box = boxes.bbox_xyxy_px[i]
        widths = widths_in(bgr, box, _in_front(boxes.bbox_xyxy_px, i), floor_px, aspect)
        sigma, std, reasons[i] = combine(widths, box)
        blur.sigma_px[i], blur.std_px[i] = sigma, std
        blur.edge_count[i] = len(widths.sigma_px)
    return Blur(blur.sigma_px, blur.std_px, blur.edge_count, tuple(reasons))


def combine(widths: Widths, box: FloatArray) -> tuple[float, float, Declined | None]:
    """Return the blur of a box's edges, its standard deviation, and why it is none.

    The median by weight of the logarithms of the widths, so that a few edges of something else do not
    move it; its error by the scatter between the cells of the box.
    """
    every = widths
    roomy = widths.take(~widths.cramped)
    scatter = EDGE_SCATTER
    if _enough(roomy, box):
        widths = roomy
    elif _enough(widths, box):
        scatter = CRAMPED_SCATTER
    else:
        return NAN, NAN, Declined.NO_EDGES
    sigma = widths.sigma_px
    relative = np.hypot(widths.std_px / sigma, scatter)
    weight = widths.length_px / relative**2
    logs = np.log(sigma)
    middle = _weighted_median(logs, weight)
    side = float(min(box[2] - box[0], box[3] - box[1])) / math.exp(middle)
    if side < MIN_SIDE_IN_SIGMA:
        return NAN, NAN, Declined.TOO_WIDE
    if side < WIDE_SIDE_IN_SIGMA and _length(every, box) < MIN_LENGTH_WHERE_WIDE:
        return NAN, NAN, Declined.TOO_WIDE
    share, z = _anisotropy(widths, weight, math.exp(middle))
    if share > MOTION_SHARE and z > MOTION_Z:
        return NAN, NAN, Declined.MOTION
    std = _error_of_median(logs - middle, weight, relative, _cells(widths.at_px, box))
    # Less than that is not declined, but the width along the motion is lower by half of it.
    turned = share / 4 if z > 2 else 0.0
    std = math.hypot(std, FORM_STD, NEARNESS / side, turned)
    return math.exp(middle), math.exp(middle) * std, None


def _enough(widths: Widths, box: FloatArray) -> bool:
    """Return whether edges are enough to speak for an object."""
    return len(widths.sigma_px) >= MIN_EDGES and _length(widths, box) >= MIN_LENGTH_OF_OUTLINE


def _length(widths: Widths, box: FloatArray) -> float:
    """Return how long edges are together, in outlines of the box."""
    outline_px = 2 * float(box[2] - box[0] + box[3] - box[1])
    return float(widths.length_px.sum()) * CELL_PX / outline_px


def widths_in(
    bgr: Image, box: FloatArray, covers: FloatArray, floor_px: float, aspect: float
) -> Widths:
    """Return the widths of all edges of a box, in pixels of the mean pitch."""
    side = float(min(box[2] - box[0], box[3] - box[1]))
    # Room for the profiles of the coarsest level that an object of this size can use.
    levels = min(max(math.log2(max(side, 1.0) / MIN_SIDE_IN_SIGMA), 0.0) + 1, MAX_LEVELS)
    room = math.ceil((REACH_PX + 4) * 2.0**levels)
    height, width = bgr.shape[:2]
    x0, y0 = (max(math.floor(v) - room, 0) for v in box[:2])
    x1, y1 = min(math.ceil(box[2]) + room + 1, width), min(math.ceil(box[3]) + room + 1, height)
    origin = np.array([x0, y0], dtype=np.float64)
    if x1 - x0 < 2 * REACH_PX + 4 or y1 - y0 < 2 * REACH_PX + 4:
        parts = []
    else:
        part = np.ascontiguousarray(bgr[y0:y1, x0:x1])
        parts = [widths_of(edges, floor_px) for edges in edges_of(part, box, covers, origin)]
    joined = Widths.join(parts)
    # Pixels need not be square: across a vertical edge it is their width that counts.
    pitch = np.hypot(joined.normal[:, 0] * aspect, joined.normal[:, 1] / aspect)
    return replace(joined, sigma_px=joined.sigma_px * pitch, std_px=joined.std_px * pitch)


def _in_front(bbox: FloatArray, i: int) -> FloatArray:
    """Return the boxes of what may be in front of one and overlaps it: lower in the picture, (k, 4)."""
    box = bbox[i]
    over = (bbox[:, 0] < box[2]) & (bbox[:, 2] > box[0])
    over &= (bbox[:, 1] < box[3]) & (bbox[:, 3] > box[1]) & (bbox[:, 3] > box[3])
    over[i] = False
    return np.asarray(bbox[over])


def _weighted_median(values: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    at = np.interp(total[-1] / 2, total - weight[order] / 2, np.arange(len(order)))
    return float(np.interp(at, np.arange(len(order)), values[order]))


def _cells(at: FloatArray, box: FloatArray) -> np.ndarray:
    share = (at - box[:2]) / np.maximum(box[2:] - box[:2], 1e-9)
    cell = np.clip(np.floor(share * CELLS), 0, CELLS - 1).astype(np.intp)
    return np.asarray(cell[:, 0] * CELLS + cell[:, 1])


def _error_of_median(
    off: FloatArray, weight: FloatArray, relative: FloatArray, cells: np.ndarray
) -> float:
    """Return the standard error of a weighted median whose errors are alike within a cell.

    By the scatter of the cells' own medians about it (the sandwich of a weighted mean), not below what
    the fits say; a median's variance is pi / 2 times a mean's.
    """
    names = np.unique(cells)
    own = np.array([_weighted_median(off[cells == c], weight[cells == c]) for c in names])
    share = np.array([weight[cells == c].sum() for c in names]) / weight.sum()
    k = len(names)
    between = (share**2 * own**2).sum() * (k / (k - 1) if k > 1 else 1.0)
    part = weight / weight.sum()
    within = (part**2 * relative**2).sum()
    if k < 3:  # nothing is known of the scatter: every edge may err like the others
        within = max(within, (part * relative**2).sum())
    return math.sqrt(np.pi / 2 * max(between, within))


def _anisotropy(widths: Widths, weight: FloatArray, middle_px: float) -> tuple[float, float]:
    """Return by which share the variance changes with the edge's direction, and over its error.

    Least squares of A + B cos 2t + C sin 2t: motion adds L^2 / 12 cos^2 (t - t0) to the variance.
    """
    near = np.abs(np.log(widths.sigma_px / middle_px)) < 0.7
    if near.sum() < 2 * MIN_EDGES:
        return 0.0, 0.0
    variance = (widths.sigma_px[near] / middle_px) ** 2
    angle = 2 * np.arctan2(widths.normal[near, 1], widths.normal[near, 0])
    design = np.column_stack([np.ones(len(angle)), np.cos(angle), np.sin(angle)])
    w = weight[near] / weight[near].mean()
    normal = design.T @ (design * w[:, None])
    # Edges of one direction only tell nothing: then the mean is believed, and no change.
    normal += np.diag([0.0, 1.0, 1.0]) * 1e-3 * len(w)
    solved = np.linalg.solve(normal, design.T @ (variance * w))
    left = variance - design @ solved
    # Edges come in bunches, along the same outline: a quarter of them is taken to be independent.
    spread = np.linalg.inv(normal) * (w * left**2).sum() / max(len(left) - 3, 1) * 4
    change = float(np.hypot(solved[1], solved[2]))
    toward = solved[1:] / max(change, 1e-12)
    error = math.sqrt(max(float(toward @ spread[1:, 1:] @ toward), 1e-12))
    return change / max(float(solved[0]), 1e-12), change / error
