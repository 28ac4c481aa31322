"""Progress of long work: a plain record that any process can send."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple


class Progress(NamedTuple):
    """Progress of one recording."""

    file_name: str
    stage: str  # "measure", "estimate", "timeline", "done"
    frames: int
    fraction: float  # of the file's bytes, 0..1
    slowest: str = ""  # what takes most of the time so far, if that is known


Report = Callable[[Progress], None]


def silent(progress: Progress) -> None:
    """Do nothing with the progress."""
