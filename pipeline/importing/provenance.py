"""Origin of a recording that was made here, as its metadata tell it."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader

RECORD = "stadimeter.import"


class ImportedVideo(NamedTuple):
    """A recording that was made of a video.

    `remarks` say what is doubtful, and why the pictures are JPEG if they are. `is_new` is False if the
    recording was there already, made of the same video.
    """

    path: Path
    frame_count: int
    camera: str
    remarks: tuple[str, ...] = ()
    is_new: bool = True


def origin_of(recording: Path) -> dict[str, str]:
    """Return what a recording says of the video that it was made of; nothing if it is of none."""
    try:
        with recording.open("rb") as stream:
            for record in make_reader(stream).iter_metadata():
                if record.name == RECORD:
                    return dict(record.metadata)
    except (McapError, OSError, ValueError, KeyError, EOFError, struct.error):
        pass  # another file, or a damaged one: not one that can be taken again
    return {}
