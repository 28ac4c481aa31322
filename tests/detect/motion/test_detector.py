"""The motion detector on figures that walk, with shadows, noise and changing light."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.config import DetectConfig
from pipeline.core.records import Boxes, Expected
from pipeline.detect.motion.detector import MotionDetector
from tests.support.footage import FRAME_NS, Walker, clip, decoded, frame

ACROSS = Walker((90.0, 300.0), (8.0, 0.5), 120.0)
FAR = Walker((600.0, 170.0), (-1.5, 0.3), 60.0, (110, 60, 30))


def detect(pictures: list[bytes], learn: slice = slice(None)) -> list[Boxes]:
    detector = MotionDetector(DetectConfig())
    images = [decoded(p) for p in pictures]
    detector.learn(images[learn][:25])
    return [detector.detect(frame(i), image) for i, image in enumerate(images)]


def errors(found: list[Boxes], walker: Walker) -> np.ndarray:
    """Return the edges' errors, (frames, 4), of the box nearest to the walker; NaN for none."""
    rows = []
    for index, boxes in enumerate(found):
        truth = np.array(walker.box(index))
        middle = (truth[:2] + truth[2:]) / 2
        row = np.full(4, np.nan)
        if len(boxes):
            centres = (boxes.bbox_xyxy_px[:, :2] + boxes.bbox_xyxy_px[:, 2:]) / 2
            distance = np.hypot(*(centres - middle).T)
            if distance.min() < 0.4 * walker.tall_px:
                row = boxes.bbox_xyxy_px[distance.argmin()] - truth
        rows.append(row)
    return np.array(rows)


@pytest.mark.parametrize("shadow", [False, True])
def test_boxes_are_tight_at_head_and_feet(shadow: bool) -> None:
    found = detect(clip([ACROSS, FAR], 40, shadow=shadow))
    for walker in (ACROSS, FAR):
        error = errors(found, walker)
        assert np.isnan(error[:, 0]).mean() < 0.1
        head, feet = np.nanmedian(error[:, 1]), np.nanmedian(error[:, 3])
        assert abs(head) < 3.0
        assert abs(feet) < 3.5
        assert np.nanstd(error[:, 1]) < 3.0


def test_people_are_people_and_stand_out() -> None:
    found = detect(clip([ACROSS], 30))
    names = [name for boxes in found for name in boxes.class_name]
    assert names.count("person") > 0.9 * len(names)
    assert all((b.score > 0.2).all() and (b.std_px > 0).all() for b in found)


def test_an_empty_scene_has_nothing_in_it() -> None:
    assert sum(len(b) for b in detect(clip([], 30, noise=6.0))) == 0


def test_a_cloud_is_no_object() -> None:
    pictures = clip([], 12)
    detector = MotionDetector(DetectConfig())
    images = [decoded(p) for p in pictures]
    detector.learn(images)
    for index, image in enumerate(images):
        image.bgr[:] = (image.bgr * 0.7).astype(np.uint8)
        assert len(detector.detect(frame(index), image)) == 0


def test_a_picture_that_is_missing_or_of_another_size_does_no_harm() -> None:
    pictures = [decoded(p) for p in clip([ACROSS], 3)]
    detector = MotionDetector(DetectConfig())
    detector.learn([])
    assert len(detector.detect(frame(0), None)) == 0
    for image in pictures:
        detector.detect(frame(1), image)


@pytest.mark.parametrize("empty", ["before", "after"])
def test_who_stands_for_most_of_the_learning_time_is_no_background(empty: str) -> None:
    stands = Walker((320.0, 300.0), (0.0, 0.0), 120.0)
    nobody = clip([], 10)
    pictures = (
        [*nobody, *clip([stands], 15)] if empty == "before" else [*clip([stands], 15), *nobody]
    )
    found = detect(pictures)
    error = errors(found, stands)
    there = slice(10, None) if empty == "before" else slice(15)
    assert np.isnan(error[there, 0]).mean() < 0.1
    assert np.abs(np.nanmedian(error[there][:, [1, 3]], axis=0)).max() < 4
    assert np.isnan(error[:10, 0]).all() if empty == "before" else np.isnan(error[15:, 0]).all()


def test_people_who_are_expected_are_told_apart() -> None:
    pair = [Walker((150.0, 300.0), (6.0, 0.0), 120.0), Walker((183.0, 292.0), (6.0, 0.0), 116.0)]
    images = [decoded(p) for p in clip([*pair, FAR, ACROSS], 40)]
    detector = MotionDetector(DetectConfig())
    detector.learn(images[:25])
    expected = np.array([w.box(30) for w in pair], dtype=float)
    people = Expected(expected, np.array([True, True]))
    found = detector.detect(frame(30), images[30], people).bbox_xyxy_px
    for true in expected:
        assert np.abs(found[:, [1, 3]] - true[[1, 3]]).max(axis=1).min() < 6


def test_pictures_may_be_prepared_elsewhere() -> None:
    images = [decoded(p) for p in clip([ACROSS], 30)]
    found = []
    for ready in (False, True):
        detector = MotionDetector(DetectConfig())
        pictures = [detector.prepared(image) if ready else image for image in images]
        assert all((picture.soft is not None) == ready for picture in pictures)
        detector.learn(pictures[:25])
        found.append([detector.detect(frame(i), p) for i, p in enumerate(pictures)])
    assert sum(len(boxes) for boxes in found[0]) > 20
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one.bbox_xyxy_px, other.bbox_xyxy_px)


def test_who_came_walking_and_stands_for_minutes_stays_in_sight() -> None:
    stands = Walker((320.0, 300.0), (0.0, 0.0), 120.0)
    empty, there = (decoded(clip(walkers, 1)[0]) for walkers in ([], [stands]))
    box = np.array([stands.box(0)], dtype=float)
    counts = []
    for walked in (True, False):
        detector = MotionDetector(DetectConfig())
        detector.learn([empty] * 5)
        people = Expected(box, np.array([walked]))
        frames_a_minute = 60 * 1_000_000_000 // FRAME_NS
        seen = [
            detector.detect(frame(minute * frames_a_minute), there, people) for minute in range(8)
        ]
        counts.append([len(boxes) for boxes in seen])
    assert counts[0] == [1] * 8
    assert counts[1][-1] == 0
