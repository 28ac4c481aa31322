"""Distortions that leave a part of the picture without directions."""

import math

import pytest

from pipeline.core.records import Intrinsics
from pipeline.run.doubts.lens_notes import lens_notes, share_without_directions

SIDE = 401


def square(k1: float) -> Intrinsics:
    middle = (SIDE - 1) / 2
    return Intrinsics(SIDE, SIDE, 400.0, 400.0, middle, middle, "plumb_bob", (k1, 0.0, 0.0, 0.0))


def test_the_share_is_what_lies_beyond_the_fold() -> None:
    """By hand: r (1 + k1 r^2) is largest at r = (-3 k1)^-1/2; a circle of its value there is left."""
    k1 = -1.5
    fold = (-3 * k1) ** -0.5
    limit_px = 400 * fold * (1 + k1 * fold**2)
    assert limit_px < SIDE / 2
    expected = 1 - math.pi * limit_px**2 / SIDE**2
    assert share_without_directions(square(k1)) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("k1", [0.0, -0.3, 0.2])
def test_nothing_is_said_of_a_lens_that_reaches_the_corners(k1: float) -> None:
    assert lens_notes("cam", square(k1)) == []
    assert lens_notes("cam", None) == []


def test_a_lens_that_folds_is_told() -> None:
    (note,) = lens_notes("cam", square(-1.5))
    assert note.code == "doubtful_lens"
    assert f"{share_without_directions(square(-1.5)):.0%} of the picture" in note.message
