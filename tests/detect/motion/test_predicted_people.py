"""People of the frames before, found again in a silhouette that holds several."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.detect.motion.groups import split_groups
from pipeline.detect.motion.predicted_people import Known, place
from tests.detect.motion.test_person_scale import OFFSET, SCALE, SLOPE, outline, person


def known(*people: tuple[int, int]) -> Known:
    """Return people of whom columns and feet are given."""
    column, foot = np.array(people, dtype=float).T
    return Known(column, foot, OFFSET + SLOPE * foot)


@pytest.mark.parametrize(("behind", "beside"), [(30, 20), (45, 8)])
def test_one_close_behind_another_is_found_by_whom_the_frames_before_knew(
    behind: int, beside: int
) -> None:
    mask = np.zeros((300, 300), np.uint8)
    far = person(mask, 100 + beside, 230 - behind)
    near = person(mask, 100, 230)
    # what was expected is a little off
    pieces = split_groups(
        outline(mask), mask, SCALE, known((103, 228), (98 + beside, 232 - behind))
    )
    assert len(pieces.boxes) == 2
    order = np.argsort(-pieces.boxes[:, 3])
    for i, true in zip(order, (near, far), strict=True):
        assert abs(pieces.boxes[i, 3] - true[3]) <= 8
        seen = ~pieces.unseen[i]
        ends = np.abs(pieces.boxes[i, [1, 3]] - np.array(true)[[1, 3]])
        assert (ends[seen] <= 3).all()


def test_who_is_not_there_is_not_found() -> None:
    mask = np.zeros((300, 300), np.uint8)
    box = person(mask, 100, 230)
    pieces = split_groups(outline(mask), mask, SCALE, known((100, 230), (104, 226)))
    assert len(pieces.boxes) == 1
    assert abs(pieces.boxes[0] - np.array(box))[[1, 3]].max() <= 1


def test_hidden_feet_follow_from_the_head() -> None:
    mask = np.zeros((300, 300), np.uint8)
    person(mask, 100, 230)
    mask[190:232, 60:140] = 255  # something that reaches below the feet
    mask[190:300, 60:140] = 255
    tall = OFFSET + SLOPE * 230
    at = place(mask, mask, 102.0, 233.0, tall)
    assert at is not None
    assert (at.top_unseen, at.bottom_unseen) == (False, True)
    assert abs(at.bottom - 230) <= 2


def test_neither_end_seen_is_nobody() -> None:
    mask = np.full((300, 300), 255, np.uint8)
    assert place(mask, mask, 100.0, 230.0, 95.0) is None


def test_what_is_as_wide_as_several_is_not_known_as_one() -> None:
    boxes = np.array([[10.0, 10.0, 40.0, 110.0], [10.0, 10.0, 110.0, 110.0]])
    of_one = Known.of_boxes(boxes)
    np.testing.assert_array_equal(of_one.column, [25.0])
    assert of_one.within(np.array([[0, 0, 60, 120], [30, 0, 60, 120]])).tolist() == [
        [True],
        [False],
    ]


def test_no_people_are_no_trouble() -> None:
    mask = np.zeros((300, 300), np.uint8)
    cv2.circle(mask, (100, 100), 30, 255, -1)
    box = outline(mask)
    np.testing.assert_array_equal(
        split_groups(box, mask, SCALE, Known.of_boxes(np.empty((0, 4)))).boxes, box
    )


def test_feet_behind_something_are_where_the_known_height_puts_them() -> None:
    mask = np.zeros((300, 300), np.uint8)
    _, top, _, foot = person(mask, 100, 230)
    mask[200:] = 0  # a parked car
    pieces = split_groups(outline(mask), mask, SCALE, known((101, 232)))
    assert abs(pieces.boxes[0, 1] - top) <= 1
    assert abs(pieces.boxes[0, 3] - foot) <= 3
    assert pieces.unseen.tolist() == [[False, True]]


def test_who_sits_down_has_no_hidden_feet() -> None:
    mask = np.zeros((300, 300), np.uint8)
    person(mask, 100, 230)
    mask[:165] = 0  # the head is a third lower than it was
    box = outline(mask)
    pieces = split_groups(box, mask, SCALE, known((100, 230)))
    np.testing.assert_array_equal(pieces.boxes, box)
    assert not pieces.unseen.any()
