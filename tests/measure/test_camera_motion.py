"""Cameras that stand, turn, shake and cut, before places that are drawn here."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.images.decode import Image, Picture
from pipeline.measure.camera_motion import CUT, MOVED, CameraMotion

WIDE, TALL = 640, 360
SECOND = 1_000_000_000


def place(seed: int) -> Image:
    """Return a place larger than the picture: rectangles of many sizes on the ground."""
    random = np.random.default_rng(seed)
    image = np.full((TALL + 200, WIDE + 200, 3), 120, dtype=np.uint8)
    for _ in range(250):
        x, y = random.integers(0, WIDE + 150), random.integers(0, TALL + 150)
        w, h = random.integers(10, 90, 2)
        grey = int(random.integers(60, 200))
        cv2.rectangle(image, (int(x), int(y)), (int(x + w), int(y + h)), (grey, grey, grey), -1)
    return image


def view(
    of: Image, right: float = 0.0, down: float = 0.0, seed: int = 0, light: float = 1.0
) -> Image:
    """Return what a camera sees of a place, displaced, with people in it and noise."""
    random = np.random.default_rng(seed)
    move = np.array([[1, 0, -100 - right], [0, 1, -100 - down]], dtype=np.float64)
    seen = cv2.warpAffine(of, move, (WIDE, TALL)).astype(np.float64) * light
    for _ in range(8):
        x, y = int(random.integers(0, WIDE - 40)), int(random.integers(0, TALL - 90))
        seen[y : y + 90, x : x + 35] = random.integers(20, 230, 3)
    return np.clip(seen + random.normal(0, 2, seen.shape), 0, 255).astype(np.uint8)


def told(views: list[Image], every_s: float = 1.0) -> list[tuple[str, int]]:
    """Return the codes of what a watch says, and the second it is said of."""
    watch, said = CameraMotion("mast"), []
    for number, image in enumerate(views):
        time_ns = round(number * every_s * SECOND)
        picture = Picture(WIDE, TALL, image, 1, 0.5, 0.0)
        note = watch.add(picture, time_ns, time_ns)
        if note is not None and note.log_time_ns is not None:
            said.append((note.code, note.log_time_ns // SECOND))
    return said


@pytest.mark.parametrize("seed", range(4))
def test_a_camera_that_stands_is_not_told(seed: int) -> None:
    here = place(seed)
    assert told([view(here, seed=n, light=1.0 - 0.03 * n) for n in range(14)]) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_cut_is_told_with_its_time(seed: int) -> None:
    here, there = place(seed), place(seed + 50)
    views = [view(here, seed=n) for n in range(8)] + [view(there, seed=n + 8) for n in range(6)]
    assert told(views) == [(CUT, 8)]


@pytest.mark.parametrize(("right", "down"), [(8.0, 0.0), (0.0, -6.0), (5.0, 5.0)])
def test_a_turn_is_told_once(right: float, down: float) -> None:
    here = place(7)
    views = [view(here, seed=n) for n in range(7)]
    views += [view(here, right, down, seed=n + 7) for n in range(6)]
    assert told(views) == [(MOVED, 7)]


def test_a_slow_turn_is_told() -> None:
    here = place(8)
    said = told([view(here, 0.4 * n, seed=n) for n in range(25)])
    assert said
    assert {code for code, _ in said} == {MOVED}


def test_a_gust_is_not_told() -> None:
    here = place(9)
    assert told([view(here, 8.0 if n == 6 else 0.0, seed=n) for n in range(12)]) == []


def test_one_wild_picture_is_not_a_cut() -> None:
    here, other = place(10), place(60)
    assert told([view(other if n == 6 else here, seed=n) for n in range(12)]) == []


def test_pictures_of_nothing_are_not_told() -> None:
    random = np.random.default_rng(1)
    grey = [random.normal(120, 2, (TALL, WIDE, 3)).astype(np.uint8) for _ in range(8)]
    noise = [random.integers(0, 255, (TALL, WIDE, 3)).astype(np.uint8) for _ in range(8)]
    assert told(grey) == []
    assert told(noise) == []


def test_pictures_between_the_seconds_cost_nothing() -> None:
    watch = CameraMotion("mast")
    image = view(place(1))
    for number in range(30):
        watch.add(Picture(WIDE, TALL, image, 1, 0.5, 0.0), number * SECOND // 10, 0)
    assert len(watch._kept) == 3
    assert watch.add(None, 4 * SECOND, 0) is None
