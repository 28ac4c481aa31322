"""Moments as people write them, and as nanoseconds."""

from __future__ import annotations

import re
from datetime import UTC, datetime

from pipeline.core.errors import UsageError


def parse_moment(text: str, start_ns: int) -> int:
    """Return the time in nanoseconds that a text names: ISO 8601, UTC if it says nothing, or seconds.

    Raises:
        UsageError: it names none.
    """
    if re.fullmatch(r"\+?\d+(\.\d+)?", text):
        return start_ns + round(float(text) * 1e9)
    whole = re.fullmatch(r"(.*:\d\d)\.(\d{1,9})(Z|[+-]\d\d:?\d\d)?", text)
    base, fraction = (whole[1] + (whole[3] or ""), whole[2]) if whole else (text, "")
    try:
        moment = datetime.fromisoformat(base)
    except ValueError as error:
        raise UsageError(
            f"--at {text!r} is not a time",
            remedy="Give ISO 8601 such as 2026-03-01T08:00:12.5Z, seconds from the start, or #frame",
        ) from error
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    since = moment - datetime(1970, 1, 1, tzinfo=UTC)
    seconds = since.days * 86_400 + since.seconds
    return seconds * 1_000_000_000 + since.microseconds * 1000 + int(fraction.ljust(9, "0") or 0)


def iso(time_ns: int) -> str:
    """Return a time as ISO 8601 in UTC."""
    moment = datetime.fromtimestamp(time_ns // 1_000_000_000, UTC)
    return f"{moment:%Y-%m-%dT%H:%M:%S}.{time_ns % 1_000_000_000 // 1000:06d}Z"
