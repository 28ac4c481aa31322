"""Files that are measured: recordings as they are, and recordings made of videos."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from pipeline.core.config import Config
from pipeline.core.errors import StadimeterError, Where
from pipeline.core.progress import Report
from pipeline.importing.provenance import ImportedVideo, origin_of
from pipeline.run.recording import Outcome, attempt
from pipeline.run.recording_paths import recordings_of
from stadimeter.importing import import_video

# fmt: off
VIDEO_SUFFIXES = frozenset({
    ".3gp", ".asf", ".avi", ".dav", ".flv", ".gif", ".ivf", ".m2ts", ".m4v", ".mkv", ".mov", ".mp4",
    ".mpeg", ".mpg", ".mts", ".obu", ".ogv", ".ts", ".webm", ".wmv",
    ".264", ".265", ".h264", ".h265", ".hevc", ".mjpeg", ".mjpg",  # bare streams
})
# fmt: on
_MAGIC = b"\x89MCAP"
_HASHED_AT_ONCE = 1 << 20


class Inputs(NamedTuple):
    """Recordings to measure, what was made for them, and what could not be made."""

    recordings: list[Path]
    made: list[ImportedVideo]
    failed: list[Outcome]


def inputs_of(given: Iterable[Path], folder: Path, config: Config, report: Report) -> Inputs:
    """Return the recordings of files; of each video one is made in a folder, unless it is there.

    In folders, videos are found beside recordings. A recording that is there and was made of the very
    same video for the same camera is taken. Lens data stay in the camera file, so that the recording can
    be measured with another one.
    """
    inputs = Inputs([], [], [])
    for path in recordings_of(given, VIDEO_SUFFIXES):
        if not is_video(path):
            inputs.recordings.append(path)
            continue
        made = attempt(path, _recording_of, path, folder, config, report)
        if isinstance(made, StadimeterError):
            inputs.failed.append(Outcome(path, error=made))
        else:
            inputs.made.append(made)
            inputs.recordings.append(made.path)
    known = {
        path.resolve(): path for path in reversed(inputs.recordings)
    }  # found, and made of a video
    inputs.recordings[:] = reversed(known.values())
    return inputs


def is_video(path: Path) -> bool:
    """Return whether a file is a video by its name, and no recording by its first bytes."""
    if path.suffix.lower() not in VIDEO_SUFFIXES or not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(_MAGIC)) != _MAGIC


def _recording_of(video: Path, folder: Path, config: Config, report: Report) -> ImportedVideo:
    """Return the recording of a video: one that is there, or a new one."""
    sha256 = _sha256(video)
    bare = Config(limits=config.limits)
    name = _camera_of(video, config)
    places = (folder / f"{video.stem}.mcap", folder / f"{video.stem}-{sha256[:8]}.mcap")
    for place in places:
        if place.exists() and (there := _made_of(place, sha256, name)) is not None:
            return there
    target = next((place for place in places if not place.exists()), None)
    if target is None:
        raise StadimeterError(
            f"its recording cannot be made: {places[0].name} and {places[1].name} are there already, "
            "and are others",
            where=Where(video),
            remedy="Name another folder with --recordings",
        )
    return import_video(
        video, target, camera=bare, name=name, provenance={"source_sha256": sha256}, progress=report
    )


def _camera_of(video: Path, config: Config) -> str:
    """Return the camera of a video: the entry that has its name, else the only one."""
    names = [camera.name for camera in config.camera]
    if video.stem in names:
        return video.stem
    return names[0] if len(names) == 1 else "camera"


def _made_of(recording: Path, sha256: str, camera: str) -> ImportedVideo | None:
    """Return a recording if it was made of a video for a camera; None if it is another."""
    metadata = origin_of(recording)
    if metadata.get("source_sha256") != sha256 or metadata.get("camera") != camera:
        return None
    remarks = tuple(text for text in metadata.get("remarks", "").split("; ") if text)
    frames = int(metadata.get("frames", "0"))
    return ImportedVideo(recording, frames, camera, remarks, is_new=False)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(_HASHED_AT_ONCE):
            digest.update(block)
    return digest.hexdigest()
