"""Boxes around turned things: corners projected one by one, and the way back."""

import numpy as np
import pytest

from pipeline.estimate.boxes.turned_box import box_around, height_share


def corners(width, height, turn, slant, depth=1000.0):
    """Project the corners of a rectangle by a pinhole, far away."""
    x, y = np.meshgrid([-width / 2, width / 2], [-height / 2, height / 2])
    point = np.stack([x.ravel(), y.ravel(), np.zeros(4)])
    c, s = np.cos(slant), np.sin(slant)
    point = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ point
    c, s = np.cos(turn), np.sin(turn)
    point = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ point
    seen = point[:2] / (1 + point[2] / depth)
    return np.ptp(seen, axis=1)


@pytest.mark.parametrize(("turn", "slant"), [(0.05, 0.0), (-0.2, 0.0), (0.0, 0.4), (0.1, -0.3)])
def test_the_box_of_a_turned_card_goes_around_its_corners(turn, slant):
    wide, tall = box_around(np.array([0.13]), np.array([0.09]), turn, slant, rounded=False)
    assert (wide[0], tall[0]) == pytest.approx(corners(0.13, 0.09, turn, slant), rel=1e-3)


def test_the_box_of_a_turned_disc_goes_around_its_rim():
    around = np.linspace(0, 2 * np.pi, 10_000)
    x, y = 0.2 * np.cos(around), 0.1 * np.sin(around)
    turn = 0.3
    rim = [x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)]
    wide, tall = box_around(np.array([0.4]), np.array([0.2]), turn, 0.0, rounded=True)
    assert (wide[0], tall[0]) == pytest.approx(tuple(np.ptp(rim, axis=1)), rel=1e-6)


def test_intervals_hold_the_heights_of_things_turned_at_random():
    random = np.random.default_rng(15)
    turn_std, slant_std, n = np.radians(3), np.radians(10), 20_000
    width, height = np.exp(random.normal(0, 0.5, (2, n)))
    inside = np.empty(n)
    turn, slant = random.normal(0, turn_std, n), random.normal(0, slant_std, n)
    rounded = random.uniform(size=n) < 0.5
    boxes = np.array(
        [
            np.ravel(box_around(width[[i]], height[[i]], turn[i], slant[i], rounded=rounded[i]))
            for i in range(n)
        ]
    )
    share = height_share(boxes[:, 0] / boxes[:, 1], turn_std, slant_std)
    off = height - boxes[:, 1] * share.mean
    inside = np.abs(off) < 1.96 * boxes[:, 1] * share.std
    assert 0.93 < inside.mean() < 0.98
    assert abs(np.mean(off / height)) < 0.005


def test_what_cannot_be_turned_is_as_high_as_its_box():
    share = height_share(np.array([0.5, 3.0, np.nan]), 0.0, 0.0)
    assert share.mean == pytest.approx([1, 1, 1])
    assert share.std == pytest.approx([0, 0, 0], abs=1e-7)


def test_boxes_of_any_shape_have_a_height():
    share = height_share(np.array([1e-9, 1e-3, 1.0, 1e3, 1e9, np.nan]), 0.05, 0.2)
    assert np.isfinite(share.mean).all()
    assert (share.mean > 0).all()
    # Of a lying pole nearly all of the box's height may be its turn; of a pole that stands nothing.
    assert share.std[3] > 0.15 > 0.05 > share.std[1]
