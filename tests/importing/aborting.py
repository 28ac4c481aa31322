"""A stand-in for a video library that ends its process in the middle of a file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from pipeline.importing.video_file import VideoImport
from pipeline.mcap_file.writer import RecordingWriter, image_message


def aborting(
    video: Path,
    recording: Path,
    options: VideoImport,
    camera: object,
    report: Callable[[int], None],
) -> int:
    """Write two frames of a video, and abort."""
    with RecordingWriter(recording) as writer:
        for count in (1, 2):
            writer.write("/i", image_message(b"x", "jpeg", count, "c"), count)
            report(count)
        os.write(2, b"Assertion failed\n")
        os.abort()


def exiting(*arguments: object) -> int:
    """End the process without a result."""
    os._exit(5)
