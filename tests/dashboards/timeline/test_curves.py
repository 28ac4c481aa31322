"""Lines over frames: every point is there, short gaps are crossed, long ones break a line."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dashboards.timeline.curves import lines_over_frames
from dashboards.timeline.error_curves import frame_medians
from dashboards.timeline.slots import LONGEST_GAP_FRAMES

POINTS = st.dictionaries(
    st.tuples(st.integers(0, 60), st.integers(0, 3)), st.floats(0, 100), min_size=1, max_size=80
)


@given(POINTS)
def test_lines_hold_the_points_and_cross_short_gaps(points: dict[tuple[int, int], float]) -> None:
    row, line = (np.array(column) for column in zip(*points, strict=True))
    value = np.array(list(points.values()))
    lines = lines_over_frames(
        row, line, line, (value, np.ones_like(value)), is_followed=True, line_count=4
    )
    assert (np.diff(lines.row) > 0).all()
    table = {(r, c): lines.values[i, c] for i, r in enumerate(lines.row) for c in range(4)}
    for point, known in points.items():
        assert table[point] == known
    for number in range(4):
        mine = np.sort(row[line == number])
        for before, after in pairwise(mine.tolist()):
            between = [table.get((r, number)) for r in range(before + 1, after)]
            if after - before <= LONGEST_GAP_FRAMES:
                straight = np.interp(
                    range(before + 1, after),
                    [before, after],
                    [points[before, number], points[after, number]],
                )
                np.testing.assert_allclose(np.array(between, dtype=float), straight, atol=1e-9)
            else:
                assert np.isnan(table[before + 1, number])  # the line ends there


def test_points_of_two_tracks_in_one_line_are_not_joined() -> None:
    lines = lines_over_frames(
        np.array([0, 3]),
        np.array([0, 0]),
        np.array([7, 8]),
        (np.array([1.0, 2.0]), np.zeros(2)),
        is_followed=True,
        line_count=1,
    )
    np.testing.assert_array_equal(lines.row, [0, 1, 3])
    np.testing.assert_array_equal(lines.values[:, 0], [1.0, np.nan, 2.0])


@given(st.lists(st.tuples(st.integers(0, 5), st.floats(-10, 10)), min_size=1, max_size=30))
def test_the_median_of_each_frame_is_numpys(pairs: list[tuple[int, float]]) -> None:
    row, value = np.array([r for r, _ in pairs]), np.array([v for _, v in pairs])
    rows, medians = frame_medians(row, value)
    np.testing.assert_array_equal(rows, np.unique(row))
    np.testing.assert_allclose(medians, [np.median(value[row == r]) for r in rows])
