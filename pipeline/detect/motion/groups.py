"""Several people in one silhouette: explained one by one, from the nearest to the farthest.

The lowest feet of a group are those of the nearest person, whom nobody hides. How tall a person is there
is known, so it is known where the head must be. What that person accounts for is taken away, and
the lowest feet of what is left are looked for. Whom nearer people hide from the waist down is left over
at the top: a head and shoulders with no feet.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from pipeline.core.arrays import BoolArray
from pipeline.detect.motion.person_scale import BoxArray, PersonScale
from pipeline.detect.motion.predicted_people import SIDE, Known, Place, place
from pipeline.images.decode import Image

# Shares of a person's height, by the proportions of the body (Drillis and Contini 1966: shoulders 0.26
# of the stature wide, head 0.13 high, hips at 0.53).
WIDE = 0.5  # somebody who stands is 0.3 wide, a stride up to as much: from here on it may be two
# A silhouette so much taller than a person is two, one behind the other. Statures differ by less, but
# what is expected may be off: a tall person who is cut is worse than two who are not.
STACKED = 1.45
# Heads are 0.13 wide, so that two that are seen are no nearer; between them the outline falls by most of
# a head.
HEADS_APART, VALLEY, LOWEST_HEAD = 0.14, 0.08, 0.6
HEAD = 0.1  # what is seen, at least, of a head above another
TRUNK = (0.45, 1.0)  # above the feet
REACH = 0.33  # of the axis, that legs and arms reach
SPINE = 0.08  # of the axis, that is filled from head to hip
FILLED = 0.5  # of that: it is a person
SHOULDERS = 0.26
# Where the top of a head is sought, below and above where it should be. If nothing is above it, it is
# seen; what goes on for longer than somebody is too tall is somebody else.
CROWN = (0.2, 0.45)
REST = 0.3  # of the height, that must be left over to be somebody
FOOT = 0.06  # of the height: the fewest pixels in a row that are a foot, and how much is one
STRIDE = 0.4  # of the height: what a leg reaches up from a foot that is beside the body
MOST = 12  # tries, at people in one silhouette
# Who was last seen alone may differ so from what is expected of a person there: statures, and the fit.
LIKELY = (0.5, 1.45)
EDGE_PX = 3
# Feet are hidden if the silhouette ends so far above them, and begins so near to where the head must be.
HIDDEN, SAME_HEAD = 0.12, 0.08
LIKELY_ALONE = 1.25  # and the height is one that is expected there
NOBODY = Known(*np.empty((3, 0)))


@dataclass(frozen=True, slots=True)
class Pieces:
    """Boxes (n, 4), and which of their upper and lower ends (n, 2) are not seen."""

    boxes: BoxArray
    unseen: npt.NDArray[np.bool_]

    @staticmethod
    def whole(box: BoxArray) -> Pieces:
        """Return a silhouette as one piece."""
        return Pieces(box[None], np.zeros((1, 2), dtype=bool))


def split_groups(boxes: BoxArray, mask: Image, scale: PersonScale, known: Known = NOBODY) -> Pieces:
    """Cut silhouettes of several people into one box each, as far as they can be told apart.

    Args:
        boxes: (n, 4) in pixels of the mask.
        mask: 255 where something stands before the background.
        scale: how tall a person is; if that is not known nothing is cut.
        known: who must be where.
    """
    whole = Pieces(boxes, np.zeros((len(boxes), 2), dtype=bool))
    if not scale.known or not len(boxes):
        return whole
    expected = scale.height_px(boxes[:, 3], boxes[:, [0, 2]].mean(axis=1))
    size = boxes[:, 2:] - boxes[:, :2]
    large = (size[:, 0] > WIDE * expected) | (size[:, 1] > STACKED * expected)
    inside = known.within(boxes)
    together = inside.sum(axis=1) > 1
    if together.any():
        inside &= _likely(known, scale, mask.shape[0])
        together = inside.sum(axis=1) > 1
    doubtful = large | together
    if (inside.sum(axis=1) == 1)[~doubtful].any():
        whole = _with_feet(boxes, inside & ~doubtful[:, None], known, scale, mask.shape[0])
    if not doubtful.any():
        return whole
    found, unseen = [whole.boxes[~doubtful]], [whole.unseen[~doubtful]]
    for i in np.flatnonzero(doubtful).tolist():
        box = boxes[i]
        if together[i] or _several(box, mask, scale):
            pieces = _explained(box, mask, scale, known.take(inside[i]))
        else:
            pieces = Pieces.whole(box)
        if len(pieces.boxes) == 1 and not large[i]:
            pieces = Pieces.whole(box)  # it may be a little taller than it was known
        found.append(pieces.boxes)
        unseen.append(pieces.unseen)
    return Pieces(np.concatenate(found), np.concatenate(unseen))


def _with_feet(
    boxes: BoxArray, inside: BoolArray, known: Known, scale: PersonScale, rows: int
) -> Pieces:
    """Return silhouettes extended to the feet of a known person, where something hides them.

    A parked car or a bench does, or trousers of the ground's colour. The head must be where it is
    expected: who sits down is shorter, and not hidden.
    """
    which, whom = inside.nonzero()
    tall, foot = known.tall[whom], known.foot[whom]
    top, bottom = boxes[which, 1], boxes[which, 3]
    hidden = (np.abs(top - (foot - tall)) < SAME_HEAD * tall) & (foot - bottom > HIDDEN * tall)
    hidden &= (bottom < rows - EDGE_PX) & (top > EDGE_PX)
    expected = scale.height_px(top + tall, known.column[whom])
    hidden &= np.abs(np.log(tall / expected)) < np.log(LIKELY_ALONE)
    unseen = np.zeros((len(boxes), 2), dtype=bool)
    if not hidden.any():
        return Pieces(boxes, unseen)
    boxes = boxes.copy()
    boxes[which[hidden], 3] = np.minimum((top + tall)[hidden].round(), rows)
    unseen[which[hidden], 1] = True
    return Pieces(boxes, unseen)


def _likely(known: Known, scale: PersonScale, rows: int) -> BoolArray:
    """Return which ones were as tall as a person is there: no parts of people, and no groups, (k,).

    Whom the picture's edge cuts is as tall as what is seen of them.
    """
    ratio = known.tall / scale.height_px(known.foot, known.column)
    cut = (known.foot - known.tall < EDGE_PX) | (known.foot > rows - EDGE_PX)
    return ~((ratio > LIKELY[1]) | (~cut & (ratio < LIKELY[0])))


def _several(box: BoxArray, mask: Image, scale: PersonScale) -> bool:
    """Return whether a silhouette is too tall for one person, or has more than one head."""
    tall = scale.tall_at(box[3], (box[0] + box[2]) / 2)
    x0, y0, x1, y1 = (int(v) for v in box)
    if y1 - y0 > STACKED * tall:
        return True
    lowest = max(y1 - round((LOWEST_HEAD - VALLEY) * tall), y0 + 1)  # of heads, and valleys
    upper = mask[y0:lowest, x0:x1]
    first = cv2.transpose(upper).argmax(axis=1)  # columns in a row, for speed
    outline = np.where(cv2.reduce(upper, 0, cv2.REDUCE_MAX)[0], (y1 - y0) - first, 0)
    outline = outline.astype(np.float32)
    outline = cv2.blur(outline[None], (max(round(0.03 * tall), 1), 1))[0]
    reach = 2 * max(round(HEADS_APART * tall), 1) + 1
    highest = cv2.dilate(outline[None], np.ones((1, reach), np.uint8))[0]
    peaks = ((outline >= highest) & (outline >= LOWEST_HEAD * tall)).nonzero()[0].tolist()
    for a, b in pairwise(peaks):
        if min(outline[a], outline[b]) - outline[a : b + 1].min() >= VALLEY * tall:
            return True
    return False


def _explained(box: BoxArray, mask: Image, scale: PersonScale, known: Known) -> Pieces:
    """Return the people in one silhouette, or the silhouette as it is if none is found in it."""
    x0, y0, x1, y1 = (int(v) for v in box)
    full = mask[y0:y1, x0:x1]
    rest = full.copy()
    boxes: list[tuple[int, int, int, int]] = []
    unseen: list[tuple[bool, bool]] = []
    placed: list[Place] = []
    rows = mask.shape[0] - y0  # down to the picture's edge
    for column, foot, tall in zip(*(v.tolist() for v in known), strict=True):
        at = place(full, rest, column - x0, foot - y0, tall)
        if at is None or any(_same_head(at, other, tall) for other in placed):
            continue
        placed.append(at)
        left, right = max(at.axis - round(REACH * tall), 0), at.axis + round(REACH * tall) + 1
        boxes.append((left, max(at.top, -y0), min(right, x1 - x0), min(at.bottom, rows)))
        unseen.append((at.top_unseen, at.bottom_unseen))
        side = round(SIDE * tall)
        rest[max(at.top, 0) : at.bottom, max(at.axis - side, 0) : at.axis + side + 1] = 0
    for _ in range(MOST):
        lowest = _lowest(rest, (x0, y0), scale)
        if lowest is None:
            break
        row, column, tall = lowest
        axis = _axis(rest, row, column, tall)
        if axis is None:
            # no body stands on it: a shadow, or the foot of somebody's stride
            low, wide = max(row - round(STRIDE * tall), 0), round(SIDE * tall)
            rest[low:, max(column - wide, 0) : column + wide + 1] = 0
            continue
        top, hidden = _head(full, row, axis, tall)
        left, right = max(axis - round(REACH * tall), 0), axis + round(REACH * tall) + 1
        boxes.append((left, top, min(right, x1 - x0), row + 1))
        unseen.append((hidden, False))
        side = round(SIDE * tall)
        rest[top : row + 1, max(axis - side, 0) : axis + side + 1] = 0
    for piece in _left_over(rest, boxes, (x0, y0), scale):
        boxes.append(piece)
        unseen.append((False, True))
    if not boxes:
        return Pieces.whole(box)
    corner = np.array([x0, y0, x0, y0], dtype=np.intp)
    return Pieces(np.array(_apart(boxes), dtype=np.intp) + corner, np.array(unseen))


def _same_head(one: Place, other: Place, tall: float) -> bool:
    """Return whether two heads are nearer to each other than two heads can be seen."""
    return abs(one.axis - other.axis) < HEADS_APART * tall and abs(one.top - other.top) < (
        HEAD * tall
    )


def _lowest(
    rest: Image, corner: tuple[int, int], scale: PersonScale
) -> tuple[int, int, float] | None:
    """Return row and column of the lowest foot of what is left, and how tall a person is there."""
    width = cv2.reduce(rest, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[:, 0]
    rows = width.nonzero()[0]
    if not len(rows):
        return None
    row = int(rows[-1])
    column = int(rest[row].argmax())
    tall = scale.tall_at(corner[1] + row + 1, corner[0] + column)
    if not tall > 0:
        return None
    thick = (width >= 255 * max(FOOT * tall, 1)).nonzero()[0]
    if not len(thick) or thick[-1] + 1 < REST * tall:
        return None
    row = int(thick[-1])
    low = max(row - round(FOOT * tall), 0)
    columns = cv2.reduce(rest[low : row + 1], 0, cv2.REDUCE_MAX)[0].nonzero()[0]
    # of several feet on a level, the one at the side: whoever is in the middle comes after
    gaps = (columns[1:] - columns[:-1] > 1).nonzero()[0]
    last = columns[gaps[0]] if len(gaps) else columns[-1]
    return row, int(columns[0] + last) // 2, tall


def _axis(rest: Image, row: int, column: int, tall: float) -> int | None:
    """Return the column of head and trunk of the person whose foot is given; None if there is none."""
    low, high = (max(row - round(share * tall), 0) for share in reversed(TRUNK))
    first = max(column - round(REACH * tall), 0)
    last = column + round(REACH * tall) + 1
    trunk = rest[low:high, first:last]
    if trunk.size == 0:
        return None
    filled = cv2.reduce(trunk, 0, cv2.REDUCE_AVG, dtype=cv2.CV_32F) / 255.0
    spine = cv2.blur(filled, (2 * round(SPINE * tall) + 1, 1), borderType=cv2.BORDER_CONSTANT)[0]
    if spine.max() < FILLED:
        return None
    # the middle of the body, not where it happens to be fullest; of two bodies the one above the foot
    wide = (2 * round(SHOULDERS / 2 * tall) + 1, 1)
    body = cv2.blur(filled, wide, borderType=cv2.BORDER_CONSTANT)[0]
    away = np.abs(np.arange(len(body)) + first - column) / tall
    return first + int(np.argmax(np.where(spine < FILLED, -1.0, body - away)))


def _head(full: Image, row: int, axis: int, tall: float) -> tuple[int, bool]:
    """Return the uppermost row of a person, and whether it is only where it must be."""
    reach = max(round(SPINE * tall), 1)
    strip = full[: row + 1, max(axis - reach, 0) : axis + reach + 1]
    filled = cv2.reduce(strip, 1, cv2.REDUCE_AVG, dtype=cv2.CV_32F)[:, 0] > 255 * 0.2
    crown = row + 1 - round(tall)
    highest = max(crown - round(CROWN[1] * tall), 0)
    lowest = min(max(crown + round(CROWN[0] * tall), 1), len(filled))
    empty = (~filled[highest:lowest]).nonzero()[0]
    if len(empty):
        return highest + int(empty[-1]) + 1, False
    if highest == 0:
        return 0, False
    return max(crown, 0), True


def _left_over(
    rest: Image,
    people: list[tuple[int, int, int, int]],
    corner: tuple[int, int],
    scale: PersonScale,
) -> list[tuple[int, int, int, int]]:
    """Return heads and shoulders of those whose feet nearer people hide."""
    outlines, _ = cv2.findContours(rest, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    found = []
    for outline in outlines:
        x, y, width, height = cv2.boundingRect(outline)
        head = corner[1] + y
        tall = scale.foot_row(head, corner[0] + x + width / 2) - head
        if not (tall > 0 and height >= REST * tall and width >= SPINE * 2 * tall):
            continue
        # somebody must be before the feet, or the feet would be seen
        below = [p for p in people if p[0] < x + width and p[2] > x and p[3] > y + height]
        if below:
            found.append((x, y, x + width, y + round(tall)))
    return found


def _apart(boxes: list[tuple[int, int, int, int]]) -> list[tuple[int, int, int, int]]:
    """Return boxes of which no two beside each other share columns: the line is midway."""
    sides = [[b[0], b[2]] for b in boxes]
    for i, one in enumerate(boxes):
        for j, other in enumerate(boxes[:i]):
            level = min(one[3], other[3]) - max(one[1], other[1])
            shorter = min(one[3] - one[1], other[3] - other[1])
            a, b = (i, j) if one[0] + one[2] <= other[0] + other[2] else (j, i)
            middle = (sum(boxes[a][::2]) + sum(boxes[b][::2])) // 4
            if level > 0.5 * shorter and boxes[a][2] > boxes[b][0]:
                sides[a][1] = max(min(sides[a][1], middle), sides[a][0] + 2)
                sides[b][0] = min(max(sides[b][0], middle), sides[b][1] - 2)
    return [(s[0], b[1], s[1], b[3]) for s, b in zip(sides, boxes, strict=True)]
