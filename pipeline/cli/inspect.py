"""`stadimeter inspect`: the content of a recording, and what is missing or damaged."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.console import err, out, print_rows, safe
from pipeline.cli.exit_codes import DAMAGED, DONE, FAILED
from pipeline.cli.options import Commands
from pipeline.core.errors import StadimeterError

if TYPE_CHECKING:
    from stadimeter import CameraSurvey, Survey


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "inspect", help="tell what is in a recording, what is missing, what is damaged"
    )
    parser.add_argument(
        "recordings",
        nargs="+",
        type=Path,
        metavar="RECORDING",
        help="files, bags, or folders of them",
    )
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file")
    parser.add_argument(
        "--whole", action="store_true", help="read and check every byte of a large recording too"
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter
    from stadimeter.arguments import recordings_in

    failed, damaged, paths = False, False, recordings_in(arguments.recordings)
    for path in paths:
        try:
            found = stadimeter.inspect(path, camera=arguments.camera, whole=arguments.whole)
        except StadimeterError as error:
            if len(paths) == 1:
                raise
            err.print(f"stadimeter: {safe(error)}", soft_wrap=True)
            failed = True
            continue
        print_survey(found)
        damaged = damaged or found.notes.lost_data
    return FAILED if failed else DAMAGED if damaged else DONE


def print_survey(survey: Survey) -> None:
    """Print what is in a recording, what is missing, and what is damaged."""
    from pipeline.core.records import Severity

    known = f"sha256 {survey.content_sha256}" if survey.is_whole else "a quick look"
    out.print(f"{safe(survey.path)}: {survey.size_bytes:,} bytes, {known}", soft_wrap=True)
    channels = [
        [c.topic, c.schema_name, c.message_encoding, f"{c.message_count:,}", c.kind or "not read"]
        for c in survey.channels
    ]
    print_rows("Channels", ("topic", "schema", "encoding", "messages", "read as"), channels)
    for camera in survey.cameras:
        _print_camera(camera)
    if not survey.cameras:
        out.print("no pictures that can be read", style="yellow")
    for name, values in survey.metadata.items():
        pairs = ", ".join(f"{k} = {v}" for k, v in values.items())
        out.print(f"metadata {safe(name)}: {safe(pairs)}", soft_wrap=True)
    for note in survey.notes:
        colour = {"error": "red", "warning": "yellow"}.get(note.severity, "")
        where = f" at byte {note.byte_offset:,}" if note.byte_offset is not None else ""
        topic = f" on {note.topic}" if note.topic else ""
        times = f" ({note.count:,} times)" if note.count > 1 else ""
        text = f"{note.severity}{where}{topic}: {note.message}{times}"
        out.print(safe(text), style=colour or None, soft_wrap=True)
    if not survey.is_whole:
        _print_quick(survey)
    elif not any(n.severity is not Severity.INFO for n in survey.notes):
        out.print("no damage found; every CRC in the file is correct")


def _print_quick(survey: Survey) -> None:
    counted = (
        "it has no summary: the counts are of that part"
        if survey.span_ns is None
        else f"by its summary it lasts {survey.span_ns / 1e9:,.1f} s, and the counts of messages are "
        "of all of it"
    )
    out.print(
        f"read and checked up to byte {survey.read_bytes:,}; {counted}; --whole reads and checks "
        "every byte",
        style="yellow",
        soft_wrap=True,
    )


def _print_camera(camera: CameraSurvey) -> None:
    from pipeline.core.records import Pairing

    seconds = (camera.last_time_ns - camera.first_time_ns) / 1e9
    out.print(
        f"camera {safe(camera.camera)}: {camera.frame_count:,} frames over {seconds:,.1f} s"
        f" ({camera.frame_rate:.2f} a second, longest gap {camera.largest_gap_ns / 1e9:.2f} s)",
        style="bold",
    )
    if camera.picture:
        out.print(f"  pictures {safe(camera.picture)}, {camera.image_bytes / 1e6:,.1f} MB")
    if camera.pose is not None:
        pose = camera.pose
        out.print(
            f"  by the transforms {pose.height_m:.2f} m above {safe(pose.ground_frame)!r}, tilted by "
            f"{math.degrees(pose.tilt_rad):.1f} degrees, rolled by {math.degrees(pose.roll_rad):.1f}"
        )
    k = camera.intrinsics
    if k is not None:
        out.print(
            f"  calibration {k.width_px}x{k.height_px}, focal length {k.fx_px:.1f} x {k.fy_px:.1f}"
            f" px, centre {k.cx_px:.1f}, {k.cy_px:.1f}, distortion "
            f"{safe(k.distortion_model or 'none')}"
        )
    paired = ", ".join(
        f"{count:,} {pairing}" for pairing, count in camera.exposure_pairings.items()
    )
    if set(camera.exposure_pairings) != {Pairing.NONE}:
        out.print(f"  exposure paired by time: {paired}")
    for name, (low, high) in camera.exposure_ranges.items():
        out.print(f"  {name} {low:g}" + (f" to {high:g}" if high > low else ""))
    if camera.truth_count:
        out.print(f"  ground truth of {camera.truth_count:,} objects in frames")
    if camera.detection_count:
        out.print(f"  {camera.detection_count:,} recorded detections")
    for sentence in camera.missing():
        out.print(f"  missing: {sentence}", style="yellow", soft_wrap=True)
