"""Labels in the picture: none lies on another while there is room, all stay inside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dashboards.timeline.labels import _chosen, _places, with_interval

PICTURE = (800.0, 600.0)
BOXES = st.lists(
    st.tuples(st.integers(0, 3), st.integers(0, 760), st.integers(0, 500), st.integers(10, 90)),
    min_size=1,
    max_size=25,
)


@given(BOXES)
@settings(deadline=None)
def test_whole_labels_never_lie_on_others(people: list[tuple[int, int, int, int]]) -> None:
    people = sorted(people)
    row = np.array([p[0] for p in people])
    boxes = np.array([[x, y, x + 30, y + h] for _, x, y, h in people], dtype=float)
    width, short = np.full(len(row), 110.0), np.full(len(row), 30.0)
    places = [
        *_places(boxes, width, 38.0, PICTURE, 4.0),
        *_places(boxes, short, 23.0, PICTURE, 4.0)[:2],
    ]
    chosen = _chosen(row, boxes, places)
    taken = np.stack(places)[chosen, np.arange(len(row))]
    assert (taken[:, :2] >= 0).all()
    assert (taken[:, 2:] <= np.array(PICTURE)).all()
    for i in range(len(row)):
        for j in range(i):
            if row[i] == row[j] and chosen[i] < 4 and chosen[j] < 4:
                low = np.maximum(taken[i, :2], taken[j, :2])
                high = np.minimum(taken[i, 2:], taken[j, 2:])
                assert not (low < high).all()


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (12.44, 0.05, "12.44 ± 0.10 m"),
        (12.44, 0.5, "12.4 ± 1.0 m"),
        (12.44, 2.0, "12 ± 4 m"),
        (0.098, 0.001, "0.098 ± 0.002 m"),
        (12.44, np.nan, "12.44 m"),
    ],
)
def test_values_have_the_digits_that_their_interval_allows(
    value: float, std: float, text: str
) -> None:
    shown = with_interval(np.array([value]), np.array([std]))[0].as_py()
    assert shown.replace("\u00a0", " ") == text
