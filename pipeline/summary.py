"""What a person is told at the end: of a run, of a recording, of its tracks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pipeline.cli.console import err, out, print_rows, safe
from pipeline.core.calibration import Calibration
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import Pairing, Severity
from pipeline.ingest.survey import CameraSurvey, Survey
from pipeline.run.recordings import RunResult
from pipeline.store.database import Store

if TYPE_CHECKING:
    from pipeline.calibrate.blur_floor import BlurFloor
    from pipeline.cluster.shared_run import SharedResult
    from pipeline.run.calibration import FittedToTruth, Found

T = TypeVar("T")

MAX_SHOWN = 10  # losses; the others are in the table `diagnostics`


def print_run(result: RunResult, database: Path) -> None:
    """Print what became of each recording, the damage, and where the results are."""
    rows = []
    for outcome in result.outcomes:
        row = outcome.recording
        if row is not None:
            missing = f"{row.frames_lost:,}" if row.frames_lost else ""
            state = "damaged" if row.damaged else ""
            rows.append([outcome.path.name, f"{row.frame_count:,}", missing, state])
    if rows:
        print_rows("Recordings", ("file", "frames", "lost", ""), rows)
    for outcome in result.failed:
        err.print(f"stadimeter: {safe(outcome.error)}", soft_wrap=True)
    out.print(f"database  {safe(database)}", soft_wrap=True)
    for outcome in result.outcomes:
        for timeline in outcome.timelines:
            out.print(f"timeline  {safe(timeline)}", soft_wrap=True)
    if result.damaged:
        with Store.open(database, read_only=True) as store:
            print_damage(store, result.run_id)
            least = "at least " if ends_are_missing(store, result.run_id) else ""
        lost = sum(o.recording.frames_lost for o in result.damaged if o.recording is not None)
        text = f"{least}{lost:,} frames were lost to damage; the table diagnostics says where"
        out.print(text, style="yellow")


def print_profile(result: RunResult) -> None:
    """Print what each stage took a frame, of each recording: elapsed, and of a processor."""
    for outcome in result.stored:
        times, row = outcome.times, outcome.recording
        frames = max(row.frame_count, 1) if row else 1
        rows = []
        for stage, spent in times.spent.items():
            threads = times.threads.get(stage, 1)
            rows.append(
                [
                    stage + (f" ({threads} threads)" if threads > 1 else ""),
                    f"{spent.elapsed_s / frames * 1e3:.3f}",
                    f"{spent.cpu_s / frames * 1e3:.3f}",
                    f"{spent.elapsed_s:.2f}",
                ]
            )
        title = f"Stages of {outcome.path.name}: {frames:,} frames, mostly {times.slowest}"
        print_rows(title, ("stage", "ms a frame", "of a processor", "s in all"), rows)


def print_shared(result: SharedResult, folder: Path) -> None:
    """Print what became of each recording of a run into a folder."""
    rows = []
    for state, found in (("was there", result.there), ("", result.made)):
        for one in found:
            manifest = one.manifest
            assert manifest is not None  # noqa: S101  (narrowing)
            lost = f"{manifest.frames_lost:,}" if manifest.frames_lost else ""
            remark = ", ".join(t for t in (state, "damaged" if manifest.damaged else "") if t)
            rows.append([one.path.name, f"{manifest.frame_count:,}", lost, remark])
    if rows:
        print_rows("Recordings", ("file", "frames", "lost", ""), rows)
    for one in result.failed:
        err.print(f"stadimeter: {safe(one.error)}", soft_wrap=True)
    out.print(f"parts  {safe(folder)}", soft_wrap=True)


def print_damage(store: Store, run_id: str) -> None:
    """Print the first diagnostics of a run that say what was lost."""
    found = store.query(
        "SELECT file_name, byte_offset, topic, count, message FROM diagnostics "
        "WHERE run_id = ? AND severity = 'error'",
        [run_id],
    ).to_pylist()
    for row in found[:MAX_SHOWN]:
        place = f" byte {row['byte_offset']:,}" if row["byte_offset"] is not None else ""
        topic = f" {row['topic']}" if row["topic"] else ""
        times = f" ({row['count']:,} times)" if row["count"] > 1 else ""
        out.print(f"  {safe(row['file_name'])}{place}{safe(topic)}: {safe(row['message'])}{times}")
    if len(found) > MAX_SHOWN:
        out.print(f"  and {len(found) - MAX_SHOWN:,} more")


def ends_are_missing(store: Store, run_id: str) -> bool:
    """Whether a recording of a run was cut, so that nobody knows what came after."""
    found = store.query(
        "SELECT count(*) AS n FROM diagnostics WHERE run_id = ? AND code = 'truncated_file'",
        [run_id],
    )
    return found.to_pylist()[0]["n"] > 0


def print_tracks(store: Store, recording_id: str, title: str) -> int:
    """Print the tracks of a recording: where, how tall, by the best method; return how many."""
    best = store.query(
        """
        SELECT track_id, camera, method, height_m, height_std_m, height_assumed, height_plausible,
            depth_min_m,
            depth_median_m, depth_max_m, observation_count
        FROM track_heights SEMI JOIN main.current_run USING (recording_id, run_id)
        WHERE recording_id = ?
        QUALIFY row_number() OVER (
            PARTITION BY camera, track_id
            -- the number that assumes the least
            ORDER BY list_position(
                ['fused', 'ground', 'defocus', 'aperture', 'inverse', 'size'], method
            )
        ) = 1
        ORDER BY camera, track_id
        """,
        [recording_id],
    ).to_pylist()
    rows = []
    for track in best:
        height = ""
        if track["height_m"] is not None:
            height = f"{track['height_m']:.2f} ± {1.96 * (track['height_std_m'] or 0):.2f}"
        rows.append(
            [
                track["track_id"],
                f"{track['observation_count']:,}",
                f"{track['depth_min_m']:.1f}",
                f"{track['depth_median_m']:.1f}",
                f"{track['depth_max_m']:.1f}",
                height + _remark(track),
                track["method"],
            ]
        )
    header = ("track", "frames", "nearest m", "median m", "farthest m", "height m (95 %)", "method")
    print_rows(title, header, rows)
    return len(rows)


def _remark(track: Mapping[str, object]) -> str:
    if track["height_assumed"]:
        return " (assumed)"
    return " (not one person)" if track["height_plausible"] is False else ""


def print_survey(survey: Survey) -> None:
    """Print what is in a recording, what is missing, and what is damaged."""
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
        out.print("no pictures that are read", style="yellow")
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
        out.print("no damage found; every CRC that the file has fits")


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
    seconds = (camera.last_time_ns - camera.first_time_ns) / 1e9
    out.print(
        f"camera {safe(camera.camera)}: {camera.frame_count:,} frames over {seconds:,.1f} s"
        f" ({camera.frame_rate:.2f} a second, longest gap {camera.largest_gap_ns / 1e9:.2f} s)",
        style="bold",
    )
    if camera.picture:
        out.print(f"  pictures {safe(camera.picture)}, {camera.image_bytes / 1e6:,.1f} MB")
    if camera.clock_steps:
        out.print(f"  the clock was set {camera.clock_steps:,} times", style="yellow")
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


def print_calibrations(fitted: FittedToTruth) -> int:
    """Print fitted parameters with standard errors, errors in and out of sample, what is refused."""
    rows = []
    for c in fitted.rows:
        for p in c.parameters:
            at = "" if math.isnan(p.f_number) else f"f/{p.f_number:g}"
            std = "" if math.isnan(p.std_error) else f"± {p.std_error:.2g}"
            rows.append(
                [c.camera, c.object_class, c.dimension, c.method, p.name, at, f"{p.value:.5g}", std]
            )
    header = ("camera", "class", "side", "method", "parameter", "at", "value", "std error")
    print_rows("Fitted", header, rows)
    names = ("camera", "class", "method", "rows", "range m", *_IN_AND_OUT, "source")
    print_rows("Errors", names, [_errors_row(c) for c in fitted.calibrations])
    if fitted.refused:
        title = "Not written: left-out depths are predicted no better than by their mean"
        print_rows(title, names, [_errors_row(c) for c in fitted.refused])
    return len(fitted.rows)


_IN_AND_OUT = ("fit RMSE cm", "leave-one-out cm", "k-fold cm")


def _errors_row(c: Calibration) -> list[str]:
    return [
        c.camera,
        c.object_class,
        c.method,
        f"{c.observation_count:,}",
        f"{c.depth_min_m:.2f}-{c.depth_max_m:.2f}",
        *(f"{100 * v:.2f}" for v in (c.fit_rmse_m, c.loo_rmse_m, c.kfold_rmse_m)),
        c.source,
    ]


def _determined(
    results: Sequence[tuple[str, T | CalibrationUndetermined]],
) -> Iterator[tuple[str, T]]:
    """Yield what was found of each camera; say of the others why nothing was."""
    for camera, result in results:
        if isinstance(result, CalibrationUndetermined):
            err.print(f"stadimeter: {safe(camera)}: {safe(result)}", soft_wrap=True)
        else:
            yield camera, result


def print_poses(
    results: Sequence[tuple[str, Found | CalibrationUndetermined]],
) -> int:
    """Print the pose of each camera, or why it is not determined; return how many are."""
    rows = []
    for camera, result in _determined(results):
        plane, lens = result.plane, result.lens
        if result.contradiction is not None:
            message = safe(result.contradiction.message)
            err.print(f"stadimeter: {safe(camera)}: {message}", soft_wrap=True)
        height_std_m, tilt_std, roll_std = (1.96 * v**0.5 for v in plane.covariance.diagonal())
        focal = f"{lens.intrinsics.fx_px:.0f} ± {1.96 * lens.std_px:.0f}" if lens else "as given"
        rows.append(
            [
                camera,
                f"{plane.camera_height_m:.2f} ± {height_std_m:.2f}",
                f"{math.degrees(plane.tilt_rad):.2f} ± {math.degrees(tilt_std):.2f}",
                f"{math.degrees(plane.roll_rad):.2f} ± {math.degrees(roll_std):.2f}",
                focal,
            ]
        )
    if rows:
        header = ("camera", "height m (95 %)", "tilt degrees", "roll degrees", "focal length px")
        print_rows("Poses from the people who walk, a recording each", header, rows)
    return len(rows)


def print_blur_floors(
    results: Sequence[tuple[str, BlurFloor | CalibrationUndetermined]],
) -> int:
    """Print how soft each camera is by itself, or why it is not known; return how many are."""
    rows = []
    for camera, result in _determined(results):
        size = f"{result.floor_px:.2f} ± {1.96 * result.std_px:.2f}"
        rows.append([camera, size, result.source, f"{result.count:,}"])
    if rows:
        header = ("camera", "softness px (95 %)", "by", "observations")
        print_rows("The cameras' own softness, without diffraction", header, rows)
    return len(rows)
