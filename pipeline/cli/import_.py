"""`stadimeter import`: a recording made of a video, or of photos."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, progress_lines, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands
from pipeline.core.errors import UsageError, Where


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
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="MCAP",
        help="recording to write (default: beside the video or the first photo, with its name)",
    )
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
        help="when the video starts, such as 2026-03-01T08:00:00+01:00 (default: as the video states it, "
        "else the file's date)",
    )
    parser.add_argument(
        "--fps",
        "--frame-rate",
        dest="frame_rate",
        type=float,
        metavar="HZ",
        help="frames a second, where the video states none or wrong times (default: its own times)",
    )
    parser.add_argument(
        "--from",
        dest="from_s",
        type=float,
        default=0.0,
        metavar="S",
        help="start of an excerpt, in seconds (default: 0)",
    )
    parser.add_argument(
        "--duration",
        type=float,
        default=float("inf"),
        metavar="S",
        help="length of the excerpt, in seconds (default: to the end)",
    )
    parser.add_argument(
        "--scale", type=float, default=1.0, help="shrink the pictures, to JPEG (default: 1)"
    )
    parser.add_argument(
        "--quality",
        type=int,
        help="make JPEG pictures of this quality, 1-100 (default: H.264, H.265, AV1 and VP9 as they "
        "are; others 90)",
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    from pipeline.importing.photos import are_photos

    for source in arguments.sources:
        if not source.exists():
            raise UsageError("there is no such file", where=Where(source))
    if are_photos(arguments.sources):
        _import_photos(arguments)
    elif len(arguments.sources) > 1:
        if arguments.output is not None:
            raise UsageError("-o names one recording; leave it out for several videos")
        for source in arguments.sources:
            _import_video(source, arguments)
    else:
        _import_video(arguments.sources[0], arguments)
    return DONE


def _import_video(video: Path, arguments: argparse.Namespace) -> None:
    import stadimeter

    with progress_lines() as progress:
        made = stadimeter.import_video(
            video,
            arguments.output,
            camera=arguments.camera,
            name=arguments.name,
            start_time=arguments.start_time,
            frame_rate=arguments.frame_rate,
            from_s=arguments.from_s,
            duration_s=arguments.duration,
            scale=arguments.scale,
            quality=arguments.quality,
            progress=progress,
        )
    size_mb = made.path.stat().st_size / 1e6
    out.print(
        f"{safe(made.path)}: {made.frame_count:,} frames, {size_mb:.1f} MB, "
        f"camera {safe(made.camera)}"
    )
    for remark in made.remarks:
        out.print(safe(remark), style="yellow", soft_wrap=True)


def _import_photos(arguments: argparse.Namespace) -> None:
    import stadimeter

    first: Path = arguments.sources[0]
    target = arguments.output or first.with_name(
        f"{first.name if first.is_dir() else first.stem}.mcap"
    )
    if arguments.output is None and target.exists():
        raise UsageError(
            "there is such a recording already", where=Where(target), remedy="Name another with -o"
        )
    with progress_lines() as progress:
        done = stadimeter.import_photos(
            arguments.sources,
            target,
            camera=arguments.camera,
            name=arguments.name,
            utc_offset=arguments.utc_offset,
            progress=progress,
        )
    for camera, count in done.counts.items():
        out.print(f"{safe(target)}: {count:,} photos of camera {safe(camera)}")
    for remark in done.remarks:
        out.print(safe(remark), style="yellow", soft_wrap=True)
