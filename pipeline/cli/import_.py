"""`stadimeter import`: a recording made of a video, or of photos."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path

from pipeline.cli.console import out, progress_lines, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands
from pipeline.core.errors import UsageError, Where
from pipeline.core.progress import Progress


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser("import", help="make a recording of a video, or of photos")
    parser.add_argument(
        "sources",
        nargs="+",
        type=Path,
        metavar="VIDEO|PHOTOS",
        help="a video, or photos and folders of them (lens data and times from their EXIF)",
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MCAP")
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file with lens data")
    parser.add_argument(
        "--name",
        help="name of the camera (default: of a video the only one in the camera file, of photos "
        "their make and model)",
    )
    parser.add_argument(
        "--utc-offset",
        default="+00:00",
        metavar="+HH:MM",
        help="of photos whose EXIF states no time zone (default: UTC)",
    )
    parser.add_argument(
        "--start-time",
        metavar="ISO",
        help="when the video starts, such as 2026-03-01T08:00:00+01:00 (default: the file's date)",
    )
    parser.add_argument("--frame-rate", type=float, metavar="HZ", help="if the video has none")
    parser.add_argument("--from", dest="from_s", type=float, default=0.0, metavar="S")
    parser.add_argument("--duration", type=float, default=float("inf"), metavar="S")
    parser.add_argument("--scale", type=float, default=1.0, help="shrink the pictures")
    parser.add_argument("--quality", type=int, default=90, help="JPEG quality, 1-100")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    from pipeline.core.config import load_config
    from pipeline.importing.photos import are_photos
    from pipeline.importing.video_file import VideoImport, import_video

    for source in arguments.sources:
        if not source.exists():
            raise UsageError("there is no such file", where=Where(source))
    if are_photos(arguments.sources):
        return _import_photos(arguments)
    if len(arguments.sources) > 1:
        raise UsageError("one video at a time, or photos and folders of them")
    arguments.video = arguments.sources[0]
    if not 1 <= arguments.quality <= 100 or not 0 < arguments.scale <= 1:
        raise UsageError("--quality must be 1 to 100, and --scale above 0 and at most 1")
    config = load_config(arguments.camera)
    name = arguments.name or (config.camera[0].name if len(config.camera) == 1 else "camera")
    options = VideoImport(
        start_time_ns=_start_time_ns(arguments),
        camera=name,
        frame_rate=arguments.frame_rate,
        from_s=arguments.from_s,
        duration_s=arguments.duration,
        scale=arguments.scale,
        jpeg_quality=arguments.quality,
    )
    with progress_lines() as report:
        frames = import_video(
            arguments.video,
            arguments.output,
            options,
            config.camera_named(name),
            lambda count: report(Progress(arguments.video.name, "import", count, 0.0)),
        )
    size_mb = arguments.output.stat().st_size / 1e6
    out.print(f"{safe(arguments.output)}: {frames:,} frames, {size_mb:.1f} MB, camera {safe(name)}")
    return DONE


def _import_photos(arguments: argparse.Namespace) -> int:
    from pipeline.core.config import load_config
    from pipeline.importing.photos import PhotoImport, import_photos, zone_of

    options = PhotoImport(camera=arguments.name, zone=zone_of(arguments.utc_offset))
    with progress_lines() as report:
        done = import_photos(
            arguments.sources,
            arguments.output,
            options,
            load_config(arguments.camera),
            lambda count: report(Progress(arguments.sources[0].name, "import", count, 0.0)),
        )
    for camera, count in done.counts.items():
        out.print(f"{safe(arguments.output)}: {count:,} photos of camera {safe(camera)}")
    for remark in done.remarks:
        out.print(safe(remark), style="yellow", soft_wrap=True)
    return DONE


def _start_time_ns(arguments: argparse.Namespace) -> int:
    if arguments.start_time is None:
        if not arguments.video.is_file():
            raise UsageError(f"{arguments.video}: there is no such file")
        return arguments.video.stat().st_mtime_ns
    try:
        start = datetime.fromisoformat(arguments.start_time)
    except ValueError as error:
        raise UsageError(f"--start-time {arguments.start_time!r} is no ISO 8601 time") from error
    start = start if start.tzinfo else start.replace(tzinfo=UTC)
    return round(start.timestamp() * 1e6) * 1000
