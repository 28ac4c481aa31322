"""Summary of a run on the terminal: cameras, people, what gave no number and why, warnings."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.console import out, print_rows, safe

if TYPE_CHECKING:
    from rich.console import Console

    from stadimeter import CameraSummary, Finding, RecordingSummary, RunSummary, TrackSummary

# More recordings than this get a line each instead of a table each.
MAX_TABLES = 5
MAX_TRACKS = 30  # of a recording; the others are in the database
MAX_FILES = 3  # names of recordings after a finding

SOURCES = {
    "recording": "by the recording",
    "camera_file": "by the camera file",
    "lens_data": "by focal length and pixel pitch",
    "walkers": "found from the people who walk",
    "given": "by the camera file",
    "transforms": "by the recording's transforms",
}


def print_summary(summary: RunSummary, database: Path) -> None:
    """Print what a run found, and every warning once."""
    if len(summary.recordings) > MAX_TABLES:
        _print_list(summary.recordings)
    else:
        for one in summary.recordings:
            _print_recording(one, database)
    print_findings(out, summary.findings)


def print_findings(console: Console, findings: Sequence[Finding]) -> None:
    """Print findings, the gravest first, each with how often and where it was found, and what to do."""
    styles = {"error": "red", "warning": "yellow"}
    for one in findings:
        label = one.severity if one.severity in styles else "note"
        text = f"{label}: {safe(one.message)} ({safe(_place(one))})"
        console.print(text, style=styles.get(one.severity, ""), soft_wrap=True)
        if one.advice:
            console.print(f"  to do: {safe(one.advice)}", soft_wrap=True)


def _place(one: Finding) -> str:
    """Return where a finding was met first, in which recordings, and how often."""
    files = ", ".join(one.recordings[:MAX_FILES])
    if len(one.recordings) > MAX_FILES:
        files += f" and {len(one.recordings) - MAX_FILES:,} more"
    parts = [files] if files else []
    if one.topic:
        parts.append(f"topic {one.topic}")
    if one.byte_offset is not None:
        parts.append(f"byte {one.byte_offset:,}")
    if one.count > 1:
        parts.append(f"{one.count:,} times")
    return ", ".join(parts) or "the run"


def print_next(database: Path, summary: RunSummary) -> None:
    """Print commands that can be pasted to go on."""
    name = shlex.quote(str(database))
    out.print(f"next      stadimeter report --db {safe(name)} -o report.html", soft_wrap=True)
    out.print(
        f"next      stadimeter query --db {safe(name)} --view accuracy.track_heights",
        soft_wrap=True,
    )
    for one in summary.recordings[:1]:
        stem = shlex.quote(Path(one.file_name).stem)
        out.print(f"next      stadimeter review --db {safe(name)} {safe(stem)}", soft_wrap=True)


def _print_list(recordings: Sequence[RecordingSummary]) -> None:
    rows = []
    for one in recordings:
        depths = [track.depth_m for track in one.tracks if track.depth_m is not None]
        reach = f"{min(depths):.1f} to {max(depths):.1f}" if depths else "no distance"
        lost = f"{one.frames_lost:,}" if one.frames_lost else ""
        rows.append(
            (
                one.file_name,
                f"{one.frames:,}",
                lost,
                f"{len(one.tracks):,}",
                reach,
                "damaged" if one.damaged else "",
            )
        )
    print_rows("Recordings", ("file", "frames", "lost", "objects", "median depth m", ""), rows)


def _print_recording(one: RecordingSummary, database: Path) -> None:
    lost = f", {one.frames_lost:,} lost" if one.frames_lost else ""
    damaged = ", damaged" if one.damaged else ""
    out.print(f"{safe(one.file_name)}: {one.frames:,} frames{lost}{damaged}", style="bold")
    for camera in one.cameras:
        out.print(f"camera {safe(camera.camera)}: {_lens(camera)}; {_pose(camera)}", soft_wrap=True)
    if one.tracks:
        print_tracks(one, f"{one.file_name}: objects, their distance and height (95 % intervals)")
    if len(one.tracks) > MAX_TRACKS:
        more = len(one.tracks) - MAX_TRACKS
        name = shlex.quote(str(database))
        out.print(f'and {more:,} more: stadimeter query --db {safe(name)} "FROM track_heights"')
    if one.is_empty:
        out.print("NO DISTANCE was estimated in this recording", style="bold red")
        if not one.tracks and not one.unmeasured:
            out.print(f"  nothing was found in its {one.frames:,} frames", soft_wrap=True)
    for gap in one.unmeasured:
        out.print(
            f"no distance for {gap.count:,} of {gap.seen:,} observations of "
            f"{safe(gap.class_name or 'objects')} ({safe(gap.camera)})",
            soft_wrap=True,
        )
        for reason in gap.reasons:
            out.print(f"  because {safe(reason)}", soft_wrap=True)
        for advice in gap.advice:
            out.print(f"  to do: {safe(advice)}", soft_wrap=True)


def print_tracks(one: RecordingSummary, title: str) -> None:
    """Print the tracks of a recording: where, how tall, by which method."""
    rows = [
        [
            track.track_id,
            track.class_name or "",
            f"{track.frames:,}",
            _metres(track.depth_min_m, 1),
            _interval(track.depth_m, track.depth_low_m, track.depth_high_m, 1),
            _metres(track.depth_max_m, 1),
            _interval(track.height_m, track.height_low_m, track.height_high_m, 2) + _remark(track),
            track.method,
        ]
        for track in one.tracks[:MAX_TRACKS]
    ]
    header = (
        "track",
        "class",
        "frames",
        "nearest m",
        "median m",
        "farthest m",
        "height m",
        "method",
    )
    print_rows(title, header, rows)


def _remark(track: TrackSummary) -> str:
    if track.height_assumed:
        return " (assumed)"
    return " (not one person)" if track.height_plausible is False else ""


def _metres(value_m: float | None, digits: int) -> str:
    return "" if value_m is None else f"{value_m:.{digits}f}"


def _interval(value: float | None, low: float | None, high: float | None, digits: int) -> str:
    if value is None:
        return ""
    if low is None or high is None:
        return f"{value:.{digits}f}"
    return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _lens(camera: CameraSummary) -> str:
    size = f"{camera.width_px} x {camera.height_px} px, " if camera.width_px else ""
    if camera.focal_length_px is None:
        return f"{size}lens unknown"
    std = f" ± {1.96 * camera.focal_length_std_px:.0f}" if camera.focal_length_std_px else ""
    source = SOURCES.get(camera.lens_source or "", camera.lens_source or "")
    return f"{size}focal length {camera.focal_length_px:.0f}{std} px, {safe(source)}"


def _pose(camera: CameraSummary) -> str:
    if camera.pose_source is None or camera.camera_height_m is None:
        return "pose unknown"
    source = SOURCES.get(camera.pose_source, camera.pose_source)
    parts = [
        f"{_with_95(camera.camera_height_m, camera.camera_height_std_m, 2)} m above the ground",
        f"tilt {_with_95(camera.tilt_deg, camera.tilt_std_deg, 1)}",
        f"roll {_with_95(camera.roll_deg, camera.roll_std_deg, 1)} degrees (95 %)",
    ]
    return f"{', '.join(parts)}, {safe(source)}"


def _with_95(value: float | None, std: float | None, digits: int) -> str:
    if value is None:
        return "unknown"
    return f"{value:.{digits}f} ± {1.96 * std:.{digits}f}" if std else f"{value:.{digits}f}"
