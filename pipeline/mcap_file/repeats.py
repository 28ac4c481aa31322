"""Chunks, and messages outside of them, that stand in a file more than once: evidence counts once."""

from __future__ import annotations

from pipeline.mcap_file.forward_file import ForwardFile

_BLOCK = 1 << 20
_MOST = 100_000  # records whose places are kept: 100 GB of usual chunks, 30 MB of memory
_RECENT = 10_000  # messages of chunks that are known again where a piece of a chunk lies loose


class Repeats:
    """Places of the records that were read, by what their heads say."""

    def __init__(self, source: ForwardFile) -> None:
        self._source = source
        self._places: dict[int, list[tuple[int, int]]] = {}
        self._newer: set[tuple[bytes, int]] = set()
        self._older: set[tuple[bytes, int]] = set()

    def remember(self, head: bytes, length: int) -> None:
        """Keep a message of a chunk in mind, for a while."""
        self._newer.add((head, length))
        if len(self._newer) > _RECENT:
            self._older, self._newer = self._newer, set()

    def is_recent(self, head: bytes, length: int) -> bool:
        """Return whether a message of a chunk had the same numbers, times and length."""
        return (head, length) in self._newer or (head, length) in self._older

    def first_place(self, head: bytes, start: int, length: int) -> int | None:
        """Return where the same bytes were read before; None if they are new.

        Args:
            head: first bytes of the record's fields (times, size, CRC, numbers), by which it is known.
            start: where its fields start.
            length: how long they are.
        """
        places = self._places.setdefault(hash((head, length)), [])
        for before, size in places:
            if before != start and size == length and self._equal(before, start, length):
                return before
        if not any(before == start for before, _ in places):
            places.append((start, length))
        if len(self._places) > _MOST:
            self._places.pop(next(iter(self._places)))
        return None

    def _equal(self, a: int, b: int, length: int) -> bool:
        return all(
            self._source.peek(a + i, min(_BLOCK, length - i))
            == self._source.peek(b + i, min(_BLOCK, length - i))
            for i in range(0, length, _BLOCK)
        )
