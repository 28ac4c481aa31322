"""Diagnostics: equal ones are counted, and no file can make endlessly many."""

from __future__ import annotations

from pipeline.core.diagnostics import MAX_KINDS, Notes
from pipeline.core.records import Diagnostic, Severity


def note(message: str, severity: Severity = Severity.WARNING, time_ns: int = 1) -> Diagnostic:
    return Diagnostic(severity, "code", message, topic="/t", byte_offset=7, log_time_ns=time_ns)


def test_equal_ones_are_one_with_a_count_and_the_first_place() -> None:
    notes = Notes()
    for time_ns in (5, 6, 9):
        notes.add(note("same", time_ns=time_ns))
    (found,) = notes
    assert (found.count, found.log_time_ns, found.end_time_ns) == (3, 5, 9)
    assert not notes.lost_data


def test_what_comes_after_too_many_is_counted_and_a_loss_stays_a_loss() -> None:
    notes = Notes()
    for number in range(MAX_KINDS + 500):
        notes.add(note(str(number)))
    assert not notes.lost_data
    for number in range(300):
        notes.add(note(f"lost {number}", Severity.ERROR))
    assert notes.lost_data
    assert len(notes) == MAX_KINDS + 2
    assert sum(n.count for n in notes) == MAX_KINDS + 800
