"""The content of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.core.errors import UsageError, Where
from stadimeter.arguments import Camera, PathLike, config_of

if TYPE_CHECKING:
    from pipeline.ingest.survey import Survey


def inspect(recording: PathLike, *, camera: Camera = None, whole: bool = False) -> Survey:
    """Return the content of a recording, and what is missing or damaged; no picture is decoded.

    Args:
        recording: MCAP file, or a bag (a folder with a metadata.yaml).
        camera: camera file, or a `Config`; None takes the defaults.
        whole: read and check every byte of a large recording too; otherwise its first 256 MiB.

    Returns:
        Channels, cameras (`cameras`), metadata and diagnostics (`notes`).

    Raises:
        UsageError: there is no such file, or a setting is unknown or impossible.
        NotARecording: the file is empty or no MCAP.
        DamagedRecording: nothing of it can be read.
    """
    from pipeline.ingest.survey import survey

    path = Path(recording)
    if not path.exists():
        raise UsageError("there is no such file", where=Where(path))
    return survey(path, config_of(camera), whole=whole)
