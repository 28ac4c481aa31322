"""Moments: every nanosecond that can be written is read back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dashboards.review.moment import iso, parse_moment
from pipeline.core.errors import UsageError

START_NS = 1_700_000_000_123_456_789


@given(st.integers(0, 4_000_000_000_000_000))
def test_a_time_is_read_back(time_us: int) -> None:
    assert parse_moment(iso(time_us * 1000), 0) == time_us * 1000


@pytest.mark.parametrize(
    ("text", "time_ns"),
    [
        ("0", START_NS),
        ("12.5", START_NS + 12_500_000_000),
        ("2023-11-14T22:13:20Z", 1_700_000_000_000_000_000),
        ("2023-11-14T22:13:20.123456789Z", START_NS),
        ("2023-11-14T23:13:20.123456789+01:00", START_NS),
        ("2023-11-14 22:13:20.5", 1_700_000_000_500_000_000),
        ("2023-11-14", 1_699_920_000_000_000_000),
    ],
)
def test_forms_of_a_time(text: str, time_ns: int) -> None:
    assert parse_moment(text, START_NS) == time_ns


@pytest.mark.parametrize("text", ["", "noon", "-5", "2023-13-01", "12:30", "1e5", "\x1b[31m"])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="is not a time"):
        parse_moment(text, START_NS)
