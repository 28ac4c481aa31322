"""The height of people in the picture, and the parts of silhouettes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.detect.motion.groups import split_groups
from pipeline.detect.motion.person_scale import PersonScale, join_parts

SLOPE, OFFSET = 0.5, -20.0


def learned(random: np.random.Generator | None = None, outliers: int = 0) -> PersonScale:
    """Return the scale of a scene in which people are half as tall as their feet's row, less 20."""
    random = random or np.random.default_rng(0)
    foot = random.uniform(100, 280, 150)
    tall = (OFFSET + SLOPE * foot) * random.normal(1, 0.05, 150)
    tall[:outliers] *= 1.9  # two people, one behind the other
    box = np.stack([np.full(150, 50.0), foot - tall, 50 + tall / 3, foot], axis=1)
    scale = PersonScale()
    scale.learn(box.round().astype(np.intp))
    return scale


def person(mask: np.ndarray, x: int, foot: int) -> tuple[int, int, int, int]:
    """Draw a silhouette with head, shoulders and legs; return its box."""
    tall = round(OFFSET + SLOPE * foot)
    top = foot - tall
    head = round(0.065 * tall)
    cv2.ellipse(mask, (x, top + head), (head, head), 0, 0, 360, 255, -1)
    cv2.line(mask, (x, top + head), (x, top + tall // 2), 255, 3)
    half = round(0.13 * tall)
    cv2.rectangle(mask, (x - half, top + round(0.16 * tall)), (x + half, top + tall // 2), 255, -1)
    leg = round(0.05 * tall)
    for side in (-1, 1):
        middle = x + side * round(0.08 * tall)
        cv2.rectangle(mask, (middle - leg, top + tall // 2), (middle + leg, foot - 1), 255, -1)
    return x - half, top, x + half + 1, foot


def outline(mask: np.ndarray) -> np.ndarray:
    x, y, w, h = cv2.boundingRect(mask)
    return np.array([[x, y, x + w, y + h]], dtype=np.intp)


def test_the_scale_is_the_line_that_most_lie_on() -> None:
    scale = learned(outliers=40)
    rows = np.array([120.0, 200.0, 260.0])
    np.testing.assert_allclose(scale.height_px(rows, 60.0), OFFSET + SLOPE * rows, rtol=0.05)


def test_nothing_is_known_of_few_or_of_what_agrees_on_nothing() -> None:
    scale = PersonScale()
    scale.learn(np.tile([[10, 10, 30, 70]], (5, 1)))
    assert not scale.known
    assert np.isnan(scale.height_px(50.0, 0.0))
    random = np.random.default_rng(1)
    tall = random.uniform(20, 200, 200)
    foot = random.uniform(200, 280, 200)
    box = np.stack([np.zeros(200), foot - tall, tall / 3, foot], axis=1).astype(np.intp)
    scale.learn(box)
    assert not scale.known


@pytest.mark.parametrize("feet", [(220, 220), (220, 205), (205, 225)])
def test_two_side_by_side_become_two(feet: tuple[int, int]) -> None:
    mask = np.zeros((300, 300), np.uint8)
    boxes = [person(mask, 100, feet[0]), person(mask, 124, feet[1])]
    cv2.rectangle(mask, (100, 170), (124, 178), 255, -1)  # they hold hands
    found = split_groups(outline(mask), mask, learned()).boxes
    assert len(found) == 2
    found = found[np.argsort(found[:, 0])]
    for piece, box in zip(found, boxes, strict=True):
        assert abs(piece[1] - box[1]) <= 2
        assert abs(piece[3] - box[3]) <= 2


def test_one_behind_the_other_is_cut_where_it_is_thin() -> None:
    mask = np.zeros((300, 300), np.uint8)
    far = person(mask, 100, 150)
    near = person(mask, 108, 272)
    cv2.line(mask, (104, far[3] - 1), (107, near[1] + 3), 255, 2)
    found = split_groups(outline(mask), mask, learned()).boxes
    assert len(found) == 2
    found = found[np.argsort(found[:, 3])]
    assert abs(found[0][3] - far[3]) <= 4
    assert abs(found[1][1] - near[1]) <= 4


@given(st.integers(110, 280), st.integers(40, 240))
def test_one_person_stays_one(foot: int, x: int) -> None:
    mask = np.zeros((300, 300), np.uint8)
    person(mask, x, foot)
    box = outline(mask)
    np.testing.assert_array_equal(split_groups(box, mask, SCALE).boxes, box)


SCALE = learned()


def test_what_is_not_known_is_not_cut() -> None:
    mask = np.full((300, 300), 255, np.uint8)
    box = np.array([[10, 10, 290, 290]], dtype=np.intp)
    np.testing.assert_array_equal(split_groups(box, mask, PersonScale()).boxes, box)


def test_legs_and_head_around_a_sign_are_one_person() -> None:
    tall = OFFSET + SLOPE * 240
    head = [100, 240 - round(tall), 130, 240 - round(0.7 * tall)]
    legs = [100, 240 - round(0.35 * tall), 130, 240]
    boxes = np.array([head, legs], dtype=np.intp)
    weight = np.array([500.0, 600.0])
    apart, _ = join_parts(boxes, weight, PersonScale())
    assert len(apart) == 2
    together, sums = join_parts(boxes, weight, SCALE)
    np.testing.assert_array_equal(together, [[100, head[1], 130, 240]])
    assert sums.tolist() == [1100.0]


def test_two_whole_people_above_each_other_stay_two() -> None:
    near = [100, 240 - round(OFFSET + SLOPE * 240), 130, 240]
    far = [104, 150 - round(OFFSET + SLOPE * 150), 122, 138]
    boxes = np.array([near, far], dtype=np.intp)
    found, _ = join_parts(boxes, np.array([900.0, 500.0]), SCALE)
    assert len(found) == 2


def test_the_scale_knows_the_camera_s_roll_and_where_the_plane_bends() -> None:
    random = np.random.default_rng(2)
    foot, column = random.uniform(100, 280, 600), random.uniform(20, 480, 600)
    tall = OFFSET + SLOPE * foot + 0.04 * column
    tall = np.where(foot > 220, 1.3 * tall, tall)  # a ramp, down from there
    tall *= random.normal(1, 0.05, 600)
    box = np.stack([column - tall / 6, foot - tall, column + tall / 6, foot], axis=1)
    scale = PersonScale()
    scale.learn(box.round().astype(np.intp))
    for row, at in ((130.0, 100.0), (180.0, 400.0), (255.0, 100.0), (260.0, 400.0)):
        true = (OFFSET + SLOPE * row + 0.04 * at) * (1.3 if row > 220 else 1.0)
        assert scale.tall_at(row, at) == pytest.approx(true, rel=0.07)
        assert float(scale.height_px(row, at)) == scale.tall_at(row, at)
    assert np.isnan(scale.tall_at(-500.0, 100.0))
    assert np.isnan(scale.foot_row(-500.0, 100.0))
    head = 180.0 - scale.tall_at(180.0, 400.0)
    assert scale.foot_row(head, 400.0) == pytest.approx(180.0, abs=8.0)


def test_a_tall_person_is_not_cut() -> None:
    mask = np.zeros((300, 300), np.uint8)
    person(mask, 100, 280)
    box = outline(mask)
    mask = cv2.resize(mask, None, fx=1, fy=1.35)[: round(300 * 1.35)]
    box = outline(mask)
    expected = float(SCALE.height_px(box[0, 3], 100.0))
    assert (box[0, 3] - box[0, 1]) / expected > 0.85
    np.testing.assert_array_equal(split_groups(box, mask, SCALE).boxes, box)


def test_what_does_not_move_is_one_sample() -> None:
    scale = PersonScale()
    for _ in range(200):
        scale.learn(np.array([[40, 100, 70, 190]]))
    assert not scale.known


def test_a_view_along_the_ground_has_people_of_one_height_everywhere() -> None:
    random = np.random.default_rng(3)
    foot = random.uniform(140, 150, 120)
    tall = 60 - 0.3 * (foot - 145) + random.normal(0, 1.5, 120)  # the nearer happen to be shorter
    left = random.uniform(0, 300, 120)
    scale = PersonScale()
    scale.learn(np.stack([left, foot - tall, left + 20, foot], axis=1).round().astype(np.intp))
    assert scale.known
    np.testing.assert_allclose(scale.height_px([140.0, 150.0], 100.0), 60, rtol=0.05)
