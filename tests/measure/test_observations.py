"""Columns kept of each box: cut sides, the object that hides it, its brightness."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.core.records import Boxes
from pipeline.core.tables import OBSERVED
from pipeline.images.decode import Picture
from pipeline.measure.observations import Seen, luminance_inside, observe
from tests.support.footage import frame


def seen(rows: list[list[float]], picture: Picture | None = None) -> Seen:
    count = len(rows)
    found = Boxes(
        np.array(rows, dtype=float).reshape(-1, 4),
        np.ones(count),
        ("person",) * count,
        np.full((count, 4), 0.5),
        (None,) * count,
    )
    light = luminance_inside(picture, found)
    return Seen(frame(3), picture, found, np.arange(count), light).without_pixels()


def picture(value: int = 255) -> Picture:
    return Picture(200, 100, np.full((50, 100, 3), value, np.uint8), 2, 1.0, 0.0)


def test_sides_at_the_pictures_edge_are_cut() -> None:
    rows = [[-0.5, 10, 20, 60], [50, 10, 60, 99.5], [50, -0.5, 199.5, 60], [50, 20, 60, 60]]
    table = observe([seen(rows, picture())], {"cam": "motion"}, 7).to_pydict()
    cut = np.array([table[f"truncated_{s}"] for s in ("left", "top", "right", "bottom")]).T
    assert cut.tolist() == [
        [True, False, False, False],
        [False, False, False, True],
        [False, True, True, False],
        [False, False, False, False],
    ]
    assert table["observation_index"] == [7, 8, 9, 10]


def test_recorded_boxes_that_go_on_beyond_the_edge_are_whole() -> None:
    table = observe([seen([[-5, -5, 20, 120]], picture())], {"cam": "recorded"}, 0).to_pydict()
    assert not any(table[f"truncated_{s}"][0] for s in ("left", "top", "right", "bottom"))


@pytest.mark.parametrize("last", [99.5, 99.0, 98.6, 100.2])
def test_recorded_boxes_that_end_at_the_pictures_edge_are_cut(last: float) -> None:
    """Some count to the middle of the last pixel, some to its outer side, some from one."""
    first = 99.0 - last
    rows = [[50, 20, 70, last], [50, first, 70, 60], [first, 20, 70, 60], [50, 20, 100 + last, 60]]
    table = observe([seen(rows, picture())], {"cam": "recorded"}, 0).to_pydict()
    cut = np.array([table[f"truncated_{s}"] for s in ("left", "top", "right", "bottom")]).T
    assert cut.tolist() == np.eye(4, dtype=bool)[[3, 1, 0, 2]].tolist()


def test_who_stands_lower_in_the_picture_hides_who_is_behind() -> None:
    rows = [[10, 10, 30, 60], [20, 20, 40, 70], [100, 10, 120, 60]]
    table = observe([seen(rows, picture())], {"cam": "motion"}, 0).to_pydict()
    assert table["occlusion"] == pytest.approx([10 * 40 / (20 * 50), 0.0, 0.0])


def test_brightness_is_that_of_the_pixels_inside() -> None:
    shown = picture(0)
    shown.bgr[10:20, 20:40] = 255
    table = observe([seen([[41, 21, 78, 38], [100, 60, 140, 90]], shown)], {"cam": "motion"}, 0)
    assert table["luminance"].to_pylist() == pytest.approx([1.0, 0.0])


def test_a_frame_without_boxes_or_picture_gives_no_nonsense() -> None:
    empty = observe([seen([])], {"cam": "motion"}, 0)
    assert empty.schema == OBSERVED
    assert empty.num_rows == 0
    table = observe([seen([[1, 2, 3, 4]])], {"cam": "motion"}, 0).to_pydict()
    assert table["luminance"] == [None]
    assert table["truncated_left"] == [False]
