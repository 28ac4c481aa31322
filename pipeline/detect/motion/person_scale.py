"""Height of a person in the picture, and so which silhouettes are parts of one.

On flat ground, the height of a person in the picture is a linear function of where their feet are in it
(both are in proportion to how far the feet are below the horizon, which a camera's roll tilts). It is
learned from the recording's own silhouettes, with no pose; groups and fragments are outliers to it.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import FloatArray

BoxArray = npt.NDArray[np.intp]

# An upright person is 2 to 4.5 times as tall as wide; a stride, a bag or a bicycle makes it less.
PERSON_ASPECT = (1.25, 6.0)
SURE_ASPECT = (1.8, 4.5)

# The fit. Statures differ by 5 %, ends of boxes by a few pixels; who is off by more is no person.
MIN_SAMPLES = 30
MAX_SAMPLES = 2000
REFIT_GROWTH = 1.2
TRIALS = 150  # pairs: with half of the samples good, none is all good with a chance of 1e-18
ROUNDS = 3
AGREE_FIRST, AGREE = 0.18, 0.12  # of the height: before and after the camera's roll is known
ROLL = 0.1  # rad, of a camera, one sigma: for when all walk on one line
SMALLEST_PX = 4.0
# Cells in which the plane is put right by what is seen there, and by how much at most.
CELL_PX, MIN_NEAR, LOCAL = 32, 10, (0.7, 1.6)
MIN_SHARE = 0.4  # of the samples must agree
# A person whose height grew by as much as the row of their feet stands straight below the camera.
STEEPEST = 0.9

# What is shorter than this is a part of a person, what is taller than that is more than one.
PART, TOO_TALL = 0.8, 1.3

# Head and legs of one person may be parted by a belt or a bag that looks like the background.
GAP = 0.3  # of the joined height
# Where it is known how tall a person is, also by a sign or a rail before them.
KNOWN_GAP = 0.5
JOINED = 1.15  # times the expected height, at most
OVERLAP = 0.5  # of the narrower fragment's width


class PersonScale:
    """The height of a person by the row of their feet, learned as recordings go by."""

    def __init__(self) -> None:
        self._samples: list[tuple[float, float, float]] = []
        self._places: set[tuple[int, ...]] = set()
        self._refit_at = MIN_SAMPLES
        self._plane: FloatArray | None = None
        self._terms: list[float] = []
        self._local = np.ones((1, 1))

    @property
    def known(self) -> bool:
        """Return whether enough upright silhouettes agreed on a line."""
        return self._plane is not None

    def height_px(self, foot_row: npt.ArrayLike, column: npt.ArrayLike) -> FloatArray:
        """Return the expected height at feet; NaN where it is not known, or no person would stand."""
        rows = np.asarray(foot_row, dtype=np.float64)
        if self._plane is None:
            return np.full(rows.shape, np.nan)
        level, down, across = self._plane
        columns = np.asarray(column, dtype=np.float64)
        at = (_cell(rows, self._local.shape[0]), _cell(columns, self._local.shape[1]))
        tall = (level + down * rows + across * columns) * self._local[at]
        return np.where(tall > SMALLEST_PX, tall, np.nan)

    def tall_at(self, foot_row: float, column: float) -> float:
        """Return the expected height at one pair of feet, as `height_px` does, at less cost."""
        if self._plane is None:
            return float("nan")
        level, down, across = self._terms
        rows, columns = self._local.shape
        i = min(max(int(foot_row / CELL_PX), 0), rows - 1)
        j = min(max(int(column / CELL_PX), 0), columns - 1)
        tall = (level + down * foot_row + across * column) * self._local.item(i, j)
        return tall if tall > SMALLEST_PX else float("nan")

    def foot_row(self, head_row: float, column: float) -> float:
        """Return the row of the feet below a head; NaN where it is not known."""
        if self._plane is None:
            return float("nan")
        level, down, across = self._plane
        foot = (head_row + level + across * column) / (1.0 - down)
        for _ in range(ROUNDS):  # the plane is put right locally: each round is nearer
            foot = head_row + self.tall_at(foot, column)
            if math.isnan(foot):
                break
        return foot

    def learn(self, boxes: BoxArray) -> None:
        """Take silhouettes (n, 4), whole ones, that look like one upright person into account."""
        if not len(boxes):
            return
        size = boxes[:, 2:] - boxes[:, :2]
        aspect = size[:, 1] / np.maximum(size[:, 0], 1)
        sure = (aspect >= SURE_ASPECT[0]) & (aspect <= SURE_ASPECT[1])
        # What stands still (something left behind, a hole in the background) is one sample, not many.
        for box, tall in zip(boxes[sure].tolist(), size[sure, 1].tolist(), strict=True):
            place = tuple(v // 2 for v in box)
            if place not in self._places:
                self._places.add(place)
                self._samples.append((float(box[3]), (box[0] + box[2]) / 2, float(tall)))
        if len(self._samples) >= self._refit_at:
            self._fit()

    def _fit(self) -> None:
        """Fit the line that most samples lie on (random sample consensus, Fischler and Bolles 1981)."""
        if len(self._samples) > MAX_SAMPLES:
            self._samples = self._samples[-MAX_SAMPLES // 2 :]
            self._places.clear()
        self._refit_at = max(round(REFIT_GROWTH * len(self._samples)), MIN_SAMPLES)
        row, column, tall = np.array(self._samples, dtype=np.float64).T
        random = np.random.default_rng(0)
        i, j = random.integers(0, len(row), (2, TRIALS))
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = np.where(row[i] == row[j], 0.0, (tall[i] - tall[j]) / (row[i] - row[j]))
        level = tall[i] - slope * row[i]
        expected = level[:, None] + slope[:, None] * row
        # Who is nearer stands lower and is larger; a level line is a view along the ground.
        agree = np.abs(expected - tall) < AGREE_FIRST * tall
        agree &= ((slope >= 0) & (slope < STEEPEST))[:, None]
        chosen = int(agree.sum(axis=1).argmax())
        best = agree[chosen]
        roll = [[0.0, 0.0, AGREE / 2 / (ROLL * max(float(slope[chosen]), 0.05))]]
        centre = float(np.mean(column))
        design = np.stack([np.ones(len(row)), row, column - centre], axis=1)
        for _ in range(ROUNDS):
            if best.sum() < max(MIN_SHARE * len(row), MIN_SAMPLES / 2):
                return  # what was known before, if it was, still is the best
            weighed = np.concatenate([design[best] / tall[best, None], roll])
            plane = np.linalg.lstsq(weighed, [*np.ones(best.sum()), 0.0], rcond=None)[0]
            if plane[1] < 0:  # a view along the ground, or few rows: a level line is as good
                plane = np.array([np.median(tall[best]), 0.0, 0.0])
            best = np.abs(design @ plane - tall) < AGREE * tall
        if plane[1] < STEEPEST:
            self._plane = np.array([plane[0] - plane[2] * centre, plane[1], plane[2]])
            self._terms = self._plane.tolist()
            self._local = _medians_nearby(
                row, column, tall / np.maximum(design @ plane, SMALLEST_PX)
            )


def _cell(pixel: npt.ArrayLike, count: int) -> npt.NDArray[np.intp]:
    """Return in which of so many cells pixels are; those beyond are in the last, or the first."""
    return np.clip(np.asarray(pixel, dtype=np.float64) / CELL_PX, 0, count - 1).astype(np.intp)


def _medians_nearby(row: FloatArray, column: FloatArray, ratio: FloatArray) -> FloatArray:
    """Return the median ratio around each cell of the picture, 1 where there are few samples.

    A wide lens bends the plane, and a ramp or a kerb is not on it.
    """
    rows, columns = (int(v.max() // CELL_PX) + 1 for v in (row, column))
    medians = np.ones((rows, columns))
    down, across = ((np.arange(n)[:, None] + 0.5) * CELL_PX for n in (rows, columns))
    for i, off in enumerate(row - down):
        nearly = np.abs(off) < CELL_PX
        beside = (column[nearly] - across) / 2
        near = np.hypot(off[nearly], beside) < CELL_PX
        for j in (near.sum(axis=1) >= MIN_NEAR).nonzero()[0]:
            medians[i, j] = np.median(ratio[nearly][near[j]])
    return np.clip(medians, *LOCAL)


def join_parts(
    boxes: BoxArray, weight: FloatArray, scale: PersonScale
) -> tuple[BoxArray, FloatArray]:
    """Join fragments that lie above each other as the parts of one upright person do.

    Args:
        boxes: (n, 4) x0 y0 x1 y1.
        weight: pixels in each, (n,).
        scale: how tall a person is.
    """
    edges, pixels = boxes.tolist(), weight.tolist()
    while len(edges) > 1:
        pairs = _above_each_other(edges)
        costs = [_joining(edges[i], edges[j], scale) for i, j in pairs]
        cost = min(costs, default=math.inf)
        if not math.isfinite(cost):
            break
        i, j = pairs[costs.index(cost)]
        both = [f(a, b) for f, a, b in zip(_OUTER, edges[i], edges[j], strict=True)]
        pixels = [w for k, w in enumerate(pixels) if k not in (i, j)] + [pixels[i] + pixels[j]]
        edges = [box for k, box in enumerate(edges) if k not in (i, j)] + [both]
    return np.array(edges, dtype=np.intp).reshape(-1, 4), np.array(pixels, dtype=np.float64)


_OUTER = (min, min, max, max)  # of the edges of two boxes


def _above_each_other(boxes: list[list[int]]) -> list[tuple[int, int]]:
    """Return which two boxes share enough columns, in order; mostly none do."""
    order = sorted(range(len(boxes)), key=lambda i: (boxes[i][0], boxes[i][2]))
    found = []
    for k, i in enumerate(order):
        left, right = boxes[i][0], boxes[i][2]
        for j in order[k + 1 :]:
            other_left, other_right = boxes[j][0], boxes[j][2]
            if other_left >= right:
                break
            narrower = min(right - left, other_right - other_left)
            if min(right, other_right) - other_left >= OVERLAP * narrower:
                found.append((min(i, j), max(i, j)))
    return sorted(found)


def _joining(one: list[int], other: list[int], scale: PersonScale) -> float:
    """Return what it costs to join two that share enough columns, infinite if they may not."""
    left, top, right, bottom = (f(a, b) for f, a, b in zip(_OUTER, one, other, strict=True))
    height = bottom - top
    gap = max(one[1], other[1]) - min(one[3], other[3])
    cost = max(gap, 0) / height
    expected = scale.tall_at(bottom, (left + right) / 2)
    shared = min(one[2], other[2]) - max(one[0], other[0])
    narrower = min(one[2] - one[0], other[2] - other[0])
    if shared >= 0.8 * narrower and gap <= 0 and not height > TOO_TALL * expected:
        return cost  # one within the other's outline
    if not PERSON_ASPECT[0] <= height / (right - left) <= PERSON_ASPECT[1]:
        return math.inf
    if math.isnan(expected):
        # Two whole people one behind the other are not parts of one: parts are shorter.
        shorter = min(one[3] - one[1], other[3] - other[1])
        return cost if gap <= GAP * height and shorter < 0.7 * height else math.inf
    if gap > KNOWN_GAP * expected or height > JOINED * expected:
        return math.inf
    return cost if _is_part(one, scale) and _is_part(other, scale) else math.inf


def _is_part(box: list[int], scale: PersonScale) -> bool:
    """Return whether a box is too short for a person there; a whole person is no part."""
    tall = scale.tall_at(box[3], (box[0] + box[2]) / 2)
    return math.isnan(tall) or box[3] - box[1] < PART * tall
