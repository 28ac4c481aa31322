"""Bounds on the work that a file may cause, counted and not timed: equal on every machine."""

from __future__ import annotations

from pipeline.core.config import Limits

_MB = 1_000_000


class Exhausted(Exception):
    """A file causes more work than a file of its size may; the text names the limit."""


class Work:
    """Counts the work of a file down.

    Args:
        limits: bounds for any file, and for each MB.
        size_bytes: size of the file.
    """

    def __init__(self, limits: Limits, size_bytes: int) -> None:
        size_mb = size_bytes / _MB
        self.bytes_left = limits.unpacked_bytes + round(limits.unpacked_bytes_per_mb * size_mb)
        self.records_left = limits.records + round(limits.records_per_mb * size_mb)
        self.places_left = limits.search_places + round(limits.search_places_per_mb * size_mb)
        self._bytes, self._records = self.bytes_left, self.records_left

    def unpack(self, count: int) -> None:
        """Count bytes that a compressed chunk became.

        Raises:
            Exhausted: they are more than the file may have.
        """
        self.bytes_left -= count
        if self.bytes_left < 0:
            raise Exhausted(
                f"its chunks unpack to more than {self._bytes:,} bytes "
                "(limits.unpacked_bytes and limits.unpacked_bytes_per_mb)"
            )

    def read_records(self, count: int = 1) -> None:
        """Count records that were read.

        Raises:
            Exhausted: they are more than the file may have.
        """
        self.records_left -= count
        if self.records_left < 0:
            raise Exhausted(
                f"it holds more than {self._records:,} records "
                "(limits.records and limits.records_per_mb)"
            )
