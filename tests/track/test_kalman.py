"""The filter against the general one: full matrices, an inverse, one track at a time."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.track.kalman import (
    ACCELERATION_STD,
    FOOT_STD,
    HEIGHT_CHANGE_STD,
    SIZE_STD,
    SPEED_STD,
    WIDTH_CHANGE_STD,
    Filters,
)

MEASURE = np.eye(4, 6)


def noise(height: float) -> np.ndarray:
    return np.diag([FOOT_STD, FOOT_STD, SIZE_STD, SIZE_STD]) ** 2 * height**2


class Textbook:
    def __init__(self, box: np.ndarray) -> None:
        self.x = np.concatenate([box, [0.0, 0.0]])
        speed = (SPEED_STD * box[2]) ** 2
        self.p = np.diag([*np.diag(noise(box[2])), speed, speed])

    def predict(self, t: float) -> None:
        move = np.eye(6)
        move[0, 4] = move[1, 5] = t
        self.x = move @ self.x
        push = np.zeros((6, 2))
        push[0, 0] = push[1, 1] = t**2 / 2
        push[4, 0] = push[5, 1] = t
        q = push @ push.T * (ACCELERATION_STD * self.x[2]) ** 2
        q[2, 2] = (HEIGHT_CHANGE_STD * self.x[2]) ** 2 * t
        q[3, 3] = (WIDTH_CHANGE_STD * self.x[2]) ** 2 * t
        self.p = move @ self.p @ move.T + q

    def spread(self) -> np.ndarray:
        return MEASURE @ self.p @ MEASURE.T + noise(self.x[2])

    def correct(self, box: np.ndarray) -> None:
        gain = self.p @ MEASURE.T @ np.linalg.inv(self.spread())
        self.x = self.x + gain @ (box - MEASURE @ self.x)
        self.p = (np.eye(6) - gain @ MEASURE) @ self.p
        self.x[2:4] = np.maximum(self.x[2:4], 1.0)


@given(st.integers(0, 100_000))
def test_it_is_the_general_filter(seed: int) -> None:
    random = np.random.default_rng(seed)
    boxes = random.uniform([0, 0, 20, 8], [900, 600, 200, 90], (4, 4)).T
    filters, books = Filters(), [Textbook(box) for box in boxes.T]
    filters.begin(boxes[:, :1])
    filters.begin(boxes[:, 1:])
    for _ in range(6):
        elapsed_s = random.uniform(0.01, 0.6)
        filters.predict(elapsed_s)
        for book in books:
            book.predict(elapsed_s)
        seen = np.flatnonzero(random.random(4) < 0.7)
        new = boxes[:, seen] + random.normal(0, 4, (4, len(seen)))
        squared, unsure = filters.distance(np.arange(4), new)
        for track, book in enumerate(books):
            off = new.T - book.x[:4]
            expected = np.einsum("bi,ij,bj->b", off, np.linalg.inv(book.spread()), off)
            np.testing.assert_allclose(squared[track], expected, rtol=1e-7)
            ratio = np.linalg.det(book.spread()) / np.linalg.det(noise(book.x[2]))
            np.testing.assert_allclose(unsure[track], ratio, rtol=1e-7)
        filters.correct(seen, new)
        for track, box in zip(seen, new.T, strict=True):
            books[track].correct(box)
        np.testing.assert_allclose(filters.state, [book.x for book in books], rtol=1e-7)
    filters.keep(np.array([True, False, False, True]))
    np.testing.assert_allclose(filters.state, [books[0].x, books[3].x], rtol=1e-7)
    assert len(filters) == 2
