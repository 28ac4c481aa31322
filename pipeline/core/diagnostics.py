"""Collecting diagnostics while a recording is read: the first of a kind is kept, the rest counted."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pyarrow as pa

from pipeline.core.records import Diagnostic, Severity
from pipeline.core.tables import DIAGNOSTICS
from pipeline.core.text import storable

# Different messages that one recording may leave; a damaged file must not fill the memory.
MAX_KINDS = 10_000


class Notes:
    """The diagnostics of one recording. Equal ones (code, topic, message) become one with a count."""

    def __init__(self) -> None:
        self._notes: dict[tuple[str, str | None, str | None, str], Diagnostic] = {}

    def __iter__(self) -> Iterator[Diagnostic]:
        return iter(self._notes.values())

    def __len__(self) -> int:
        return len(self._notes)

    def add(self, note: Diagnostic) -> None:
        """Keep a diagnostic, or count it if its like was seen."""
        key = (note.code, note.camera, note.topic, note.message)
        seen = self._notes.get(key)
        if seen is None and len(self._notes) >= MAX_KINDS:
            text = "further diagnostics, too many to tell apart"
            note = replace(note, code="further", message=text, camera=None, topic=None)
            key = (note.code, None, None, str(note.severity))
            seen = self._notes.get(key)
        if seen is None:
            self._notes[key] = note
            return
        ends = [t for t in (seen.end_time_ns, note.end_time_ns, note.log_time_ns) if t is not None]
        self._notes[key] = replace(
            seen, count=seen.count + note.count, end_time_ns=max(ends, default=None)
        )

    def count(self, *codes: str) -> int:
        """Return how often any of `codes` happened."""
        return sum(n.count for n in self._notes.values() if n.code in codes)

    @property
    def lost_data(self) -> bool:
        """Return whether anything in the input could not be read."""
        return any(n.severity is Severity.ERROR for n in self._notes.values())


def diagnostics_table(notes: list[Diagnostic]) -> pa.Table:
    """Return the notes as rows of the table `diagnostics`."""
    columns = {
        name: [_storable(getattr(n, name)) for n in notes]
        for name in DIAGNOSTICS.names
        if name != "severity"
    }
    columns["severity"] = [str(n.severity) for n in notes]
    return pa.table(columns, schema=DIAGNOSTICS)


def _storable(value: object) -> object:
    return storable(value) if isinstance(value, str) else value
