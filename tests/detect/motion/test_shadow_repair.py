"""Legs that were taken for shadow, ghosts, and people before each other."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.detect.motion.ghosts import Ghosts
from pipeline.detect.motion.groups import split_groups
from pipeline.detect.motion.person_scale import PersonScale
from pipeline.detect.motion.shadow_repair import repair
from tests.detect.motion.test_person_scale import OFFSET, SLOPE, learned, outline, person

FOOT = 250
TALL = round(OFFSET + SLOPE * FOOT)


def test_legs_that_look_like_shadow_are_given_back() -> None:
    raw = np.zeros((300, 300), np.uint8)
    person(raw, 150, FOOT)
    raw[FOOT - 8 : FOOT, 150:230] = 255  # a shadow, to the right
    mask = raw.copy()
    mask[FOOT - TALL // 2 :] = 0
    boxes, doubt = repair(outline(mask), mask, raw, learned())
    assert doubt.tolist() == [True]
    assert abs(boxes[0, 3] - FOOT) <= 1
    assert mask[FOOT - 15, 150 - 7] == 255


def test_a_shadow_is_not_given_back() -> None:
    raw = np.zeros((300, 300), np.uint8)
    person(raw, 150, FOOT - 40)
    mask = raw.copy()
    raw[FOOT - 40 : FOOT, 140:160] = 255  # towards the camera
    boxes, doubt = repair(outline(mask), mask, raw, learned())
    assert doubt.tolist() == [True]
    assert boxes[0, 3] == FOOT - 40
    again, doubt = repair(outline(mask), mask, raw, PersonScale())
    assert doubt.tolist() == [True]
    np.testing.assert_array_equal(again, boxes)


def test_what_nothing_was_taken_from_is_not_in_doubt() -> None:
    mask = np.zeros((300, 300), np.uint8)
    person(mask, 150, FOOT)
    boxes, doubt = repair(outline(mask), mask, mask.copy(), learned())
    assert not doubt.any()
    np.testing.assert_array_equal(boxes, outline(mask))


def test_who_is_hidden_from_the_waist_is_a_head_without_feet() -> None:
    mask = np.zeros((300, 300), np.uint8)
    near = person(mask, 150, 270)
    person(mask, 184, 232)
    pieces = split_groups(outline(mask), mask, learned())
    assert len(pieces.boxes) == 2
    nearest = int(pieces.boxes[:, 3].argmax())
    assert abs(pieces.boxes[nearest, 3] - near[3]) <= 1
    assert not pieces.unseen[nearest, 1]


def test_a_hole_in_the_background_is_told_from_somebody_who_stands() -> None:
    random = np.random.default_rng(1)
    empty = cv2.GaussianBlur(random.normal(120, 30, (200, 200, 3)), (0, 0), 4).astype(np.uint8)
    there = empty.copy()
    body = np.zeros((200, 200), np.uint8)
    x0, y0, x1, y1 = person(body, 100, 180)
    there[body > 0] = (40, 30, 90)
    box = (x0, y0, x1, y1)
    for image, background, holes in ((empty, there, [box]), (there, empty, [])):
        ghosts = Ghosts()
        found = [ghosts.find([box], image, background, body, t) for t in (0.0, 1.0, 2.0, 3.0)]
        assert found == [[], [], [], holes]


def test_what_moves_is_no_hole() -> None:
    ghosts, picture = Ghosts(), np.zeros((100, 100, 3), np.uint8)
    mask = np.full((100, 100), 255, np.uint8)
    for i in range(9):
        box = (10 + 8 * i, 10, 30 + 8 * i, 60)
        assert ghosts.find([box], picture, picture, mask, float(i)) == []
