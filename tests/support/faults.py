"""Faults: the n-th operation of Python on files below a folder fails, once.

An audit hook sees every operation before it is done, and its exception is the operation's. It cannot
be taken away again, so there is one, which does nothing unless a fault is set.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

OPERATIONS = frozenset(
    ("open", "os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.truncate", "tempfile.mkstemp")
)


@dataclass
class Fault:
    """The operation that is to fail, and what was done so far."""

    folder: str
    at: int | None
    code: int
    seen: list[str] = field(default_factory=list)


_current: Fault | None = None
_installed = False


def _hook(event: str, arguments: tuple[object, ...]) -> None:
    fault = _current
    if fault is None or event not in OPERATIONS:
        return
    path = arguments[0] if arguments else None
    if not isinstance(path, str | bytes) or fault.folder not in os.fsdecode(path):
        return
    fault.seen.append(f"{event} {os.fsdecode(path)}")
    if fault.at is not None and len(fault.seen) - 1 == fault.at:
        raise OSError(fault.code, os.strerror(fault.code), os.fsdecode(path))


@contextmanager
def failing(folder: object, at: int | None, code: int = errno.ENOSPC) -> Iterator[Fault]:
    """Let one operation on files whose path has `folder` in it fail; None counts them only."""
    global _current, _installed
    if not _installed:
        sys.addaudithook(_hook)
        _installed = True
    _current = Fault(str(folder), at, code)
    try:
        yield _current
    finally:
        _current = None
