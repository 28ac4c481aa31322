"""Recordings made of videos and of photos."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.core.errors import UsageError, Where
from pipeline.importing.provenance import ImportedVideo as ImportedVideo
from stadimeter.arguments import Camera, OnProgress, PathLike, config_of, counter_of, paths_of

if TYPE_CHECKING:
    from pipeline.importing.photos import Imported


def import_video(
    video: PathLike,
    recording: PathLike | None = None,
    *,
    camera: Camera = None,
    name: str | None = None,
    start_time: datetime | str | None = None,
    frame_rate: float | None = None,
    from_s: float = 0.0,
    duration_s: float = math.inf,
    scale: float = 1.0,
    quality: int | None = None,
    provenance: Mapping[str, str] | None = None,
    progress: OnProgress = None,
) -> ImportedVideo:
    """Make a recording of a video, with the lens data of a camera file.

    Pictures in H.264, H.265, AV1 and VP9 are taken as they are, without encoding them anew; that needs
    the extra `video`. Others become JPEG, and so do these where the library is missing, where they are
    to be turned or made smaller, or where a quality is given; the remarks say it.

    Args:
        video: file that FFmpeg can read.
        recording: MCAP file to write; None writes beside the video, with its name.
        camera: camera file, or a `Config`; None takes the defaults.
        name: name of the camera; None takes the only one of the camera file, else "camera".
        start_time: time of the first frame, as a datetime or ISO 8601; UTC if it has no offset.
            None takes the time of creation that the video states, else the date of the file.
        frame_rate: frames a second, where the video states none or wrong times; None takes the times
            that the video states.
        from_s: start of an excerpt, in seconds; its frames keep the times of the whole video. Pictures
            that are taken as they are begin with the key frame before.
        duration_s: length of the excerpt, in seconds.
        scale: factor by which the pictures are made smaller, above 0 and at most 1.
        quality: quality of JPEG pictures, 1 to 100; None takes packets where it can be, else 90.
        provenance: more to say in the metadata of the recording.
        progress: called with a `Progress` while the work goes on.

    Raises:
        UsageError: an argument is impossible, or the frame rate is unknown.
        StadimeterError: the video cannot be read, or has no frame in the excerpt.
    """
    from pipeline.importing import video_file, video_packets

    path = Path(video)
    target = path.with_suffix(".mcap") if recording is None else Path(recording)
    if not path.is_file():
        raise UsageError("there is no such file", where=Where(path))
    if (quality is not None and not 1 <= quality <= 100) or not 0 < scale <= 1:
        raise UsageError("the quality must be 1 to 100, and the scale above 0 and at most 1")
    if recording is None and target.exists():
        raise UsageError("there is such a recording already", where=Where(target), remedy=_NAME_ONE)
    config = config_of(camera)
    name = name or (config.camera[0].name if len(config.camera) == 1 else "camera")
    options = video_file.VideoImport(
        start_time_ns=_time_ns(start_time, path),
        camera=name,
        frame_rate=frame_rate,
        from_s=from_s,
        duration_s=duration_s,
        scale=scale,
        jpeg_quality=_QUALITY if quality is None else quality,
        provenance={"camera": name} | dict(provenance or {}),
    )
    work = (path, target, options, config.camera_named(name), counter_of(progress, path.name))
    why = "a quality is given"
    if quality is None:
        try:
            made = video_packets.import_packets(*work)
        except video_packets.MustBeReencoded as error:
            why = f"{error.problem}. {error.remedy}".rstrip(". ")
        else:
            return ImportedVideo(target, made.frame_count, name, tuple(made.remarks))
    count = video_file.import_video(*work)
    return ImportedVideo(target, count, name, (f"the pictures became JPEG: {why}",))


_QUALITY = 90
_NAME_ONE = "Name the recording to write with -o"


def import_photos(
    photos: PathLike | Iterable[PathLike],
    recording: PathLike,
    *,
    camera: Camera = None,
    name: str | None = None,
    utc_offset: str = "+00:00",
    progress: OnProgress = None,
) -> Imported:
    """Make a recording of photos, in the order of their time, with the lens data of their EXIF.

    Args:
        photos: JPEG, PNG or WebP files, or folders of them at any depth.
        recording: MCAP file to write.
        camera: camera file, or a `Config`; None takes the defaults.
        name: name of the camera; None takes make and model of each photo.
        utc_offset: offset (+HH:MM) of photos whose EXIF states no time zone.
        progress: called with a `Progress` while the work goes on.

    Returns:
        Number of photos by camera (`counts`), and remarks on photos that were left out or doubtful.

    Raises:
        UsageError: a path does not exist, or the offset is none.
        StadimeterError: there is no photo that can be read.
    """
    from pipeline.importing.photos import PhotoImport, zone_of
    from pipeline.importing.photos import import_photos as make

    sources = paths_of(photos)
    if not sources:
        raise UsageError("no photo is given")
    for source in sources:
        if not source.exists():
            raise UsageError("there is no such file", where=Where(source))
    options = PhotoImport(camera=name, zone=zone_of(utc_offset))
    count = counter_of(progress, sources[0].name)
    return make(sources, Path(recording), options, config_of(camera), count)


def _time_ns(start: datetime | str | None, video: Path) -> int:
    """Return the time at which a video starts: as given, as it states, or the date of its file."""
    from pipeline.importing.video_packets import start_time_ns

    if start is None:
        stated_ns = start_time_ns(video)
        return video.stat().st_mtime_ns if stated_ns is None else stated_ns
    if isinstance(start, str):
        try:
            start = datetime.fromisoformat(start)
        except ValueError as error:
            raise UsageError(f"the start time {start!r} is no ISO 8601 time") from error
    start = start if start.tzinfo else start.replace(tzinfo=UTC)
    return round(start.timestamp() * 1e6) * 1000
