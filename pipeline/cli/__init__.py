"""The command `stadimeter`: arguments in, messages and exit codes out. The work is elsewhere.

Exit codes: 0 done; 1 failed; 2 wrong usage; 3 done, but some input was damaged or refused (its rows
are in the table `diagnostics`).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import __version__
from pipeline.core.errors import StadimeterError, UsageError, Where

if TYPE_CHECKING:
    from pipeline.calibrate.walkers.known_lengths import Known
    from pipeline.core.config import Config, DetectConfig, TimelineConfig

DONE, FAILED, USAGE, DAMAGED = 0, 1, 2, 3
DEFAULT_DB = Path("stadimeter.duckdb")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code."""
    parser = build_parser()
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.print_help()
        return USAGE
    try:
        code: int = arguments.function(arguments)
    except StadimeterError as error:
        if arguments.debug:
            raise
        from pipeline.cli.console import err, safe

        err.print(f"stadimeter: {safe(error)}", soft_wrap=True)
        return USAGE if isinstance(error, UsageError) else FAILED
    except KeyboardInterrupt:
        print("stadimeter: interrupted; what was committed is kept", file=sys.stderr)
        return 130
    except BrokenPipeError:  # `stadimeter query ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    return code


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with all commands."""
    parser = argparse.ArgumentParser(
        prog="stadimeter",
        description="Distances and heights, with intervals, of what recorded footage shows.",
    )
    parser.add_argument("--version", action="version", version=f"stadimeter {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    _add_run(commands)
    _add_inspect(commands)
    _add_import(commands)
    _add_calibrate(commands)
    _add_estimate(commands)
    _add_query(commands)
    _add_merge(commands)
    _add_report(commands)
    _add_export(commands)
    _add_review(commands)
    _add_demo(commands)
    for command in commands.choices.values():
        command.add_argument("--debug", action="store_true", help="show tracebacks")
    return parser


def _add_shared(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("many machines")
    group.add_argument(
        "--parts",
        type=Path,
        metavar="DIR",
        help="write Parquet files here, which all machines see, not a database; "
        "what is there already is not done again",
    )
    group.add_argument("--engine", choices=("local", "ray"), default="local")
    group.add_argument("--address", help="a running Ray cluster (default: start a local one)")
    group.add_argument(
        "--split",
        type=float,
        default=600.0,
        metavar="S",
        help="cut long recordings into windows of so many seconds; 0: leave them whole",
    )


Commands = argparse._SubParsersAction  # the type has no public name


def _add_run(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser("run", help="measure recordings into a database")
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING")
    _add_db(parser)
    parser.add_argument("--rrd", type=Path, metavar="DIR", help="write a Rerun timeline of each")
    _add_preview(parser, "--rrd-preview")
    parser.add_argument(
        "--rrd-split",
        type=float,
        metavar="MINUTES",
        help="a timeline for each so many minutes of a recording (default: 60)",
    )
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file")
    parser.add_argument("--detector", choices=("auto", "recorded", "roi", "motion", "onnx"))
    parser.add_argument("--model", type=Path, metavar="FILE", help="the network of onnx")
    parser.add_argument("--model-family", metavar="NAME", help="where its outputs fit several")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes")
    _add_shared(parser)
    parser.add_argument("--label", help="a name for this run, to compare it with others")
    parser.add_argument("--profile", action="store_true", help="print what each stage took")
    parser.set_defaults(function=_run)


def _run(arguments: argparse.Namespace) -> int:
    from dataclasses import replace

    from pipeline.cli.console import progress_lines
    from pipeline.core.config import load_config
    from pipeline.run.recordings import run
    from pipeline.summary import print_profile, print_run

    if arguments.workers < 1:
        raise UsageError("--workers must be at least 1")
    config = load_config(arguments.camera)
    config = replace(
        config,
        detect=_detect_config(arguments, config.detect),
        timeline=_timeline_config(config.timeline, arguments.rrd_preview, arguments.rrd_split),
    )
    if arguments.parts is not None:
        return _run_shared(arguments, config)
    if arguments.engine != "local" or arguments.address is not None:
        raise UsageError("--engine ray needs --parts DIR, a folder that all machines see")
    with progress_lines() as report:
        result = run(
            arguments.recordings,
            arguments.db,
            config,
            timelines=arguments.rrd,
            workers=arguments.workers,
            label=arguments.label,
            report=report,
        )
    print_run(result, arguments.db)
    if arguments.profile:
        print_profile(result)
    return _code_of(result.stored, result.failed, result.damaged)


def _run_shared(arguments: argparse.Namespace, config: Config) -> int:
    from pipeline.cli.console import progress_lines
    from pipeline.cluster.shared_run import run_shared
    from pipeline.summary import print_shared

    if arguments.rrd is not None:
        raise UsageError("--rrd needs a database: leave out --parts")
    if arguments.address is not None and arguments.engine != "ray":
        raise UsageError("--address belongs to --engine ray")
    with progress_lines() as report:
        result = run_shared(
            arguments.recordings,
            arguments.parts,
            config,
            engine=arguments.engine,
            address=arguments.address,
            workers=arguments.workers,
            window_s=arguments.split,
            label=arguments.label,
            report=report,
        )
    print_shared(result, arguments.parts)
    return _code_of(result.stored, result.failed, result.damaged)


def _detect_config(arguments: argparse.Namespace, detect: DetectConfig) -> DetectConfig:
    """Return how to detect: what the command line says goes before the camera file."""
    from dataclasses import replace

    if arguments.model is not None:
        if arguments.detector not in (None, "onnx"):
            raise UsageError(f"--model goes with --detector onnx, not {arguments.detector}")
        detect = replace(detect, method="onnx", model=str(arguments.model))
    if arguments.model_family is not None:
        detect = replace(detect, model_family=arguments.model_family)
    if arguments.detector is not None:
        detect = replace(detect, method=arguments.detector)
    if detect.method == "onnx":  # a wrong model is told once, before hours of footage
        from pipeline.detect.network.detector import OnnxDetector

        OnnxDetector(detect)
    return detect


def _code_of(stored: Sequence[object], failed: Sequence[object], damaged: Sequence[object]) -> int:
    if not stored:
        return FAILED
    return DAMAGED if failed or damaged else DONE


def _add_inspect(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "inspect", help="tell what is in a recording, what is missing, what is damaged"
    )
    parser.add_argument("recording", type=Path, metavar="RECORDING")
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file")
    parser.add_argument(
        "--whole", action="store_true", help="read and check every byte of a large recording too"
    )
    parser.set_defaults(function=_inspect)


def _inspect(arguments: argparse.Namespace) -> int:
    from pipeline.core.config import load_config
    from pipeline.ingest.survey import survey
    from pipeline.summary import print_survey

    if not arguments.recording.is_file():
        raise UsageError("there is no such file", where=Where(arguments.recording))
    found = survey(arguments.recording, load_config(arguments.camera), whole=arguments.whole)
    print_survey(found)
    return DAMAGED if found.notes.lost_data else DONE


def _add_import(commands: Commands[argparse.ArgumentParser]) -> None:
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
    parser.set_defaults(function=_import)


def _import(arguments: argparse.Namespace) -> int:
    from pipeline.cli.console import out, progress_lines, safe
    from pipeline.core.config import load_config
    from pipeline.core.progress import Progress
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
    from pipeline.cli.console import out, progress_lines, safe
    from pipeline.core.config import load_config
    from pipeline.core.progress import Progress
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


def _add_calibrate(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "calibrate", help="fit a camera file to truth, to people who walk, or to blur"
    )
    parser.add_argument(
        "recordings", nargs="*", type=Path, metavar="RECORDING", help="run these first"
    )
    _add_db(parser)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="TOML", help="camera file to write"
    )
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file for the run")
    parser.add_argument(
        "--walkers", action="store_true", help="find the camera's pose from people who walk"
    )
    parser.add_argument(
        "--blur",
        action="store_true",
        help="find the camera's own softness from aperture sweeps, truth, or its sharpest objects",
    )
    parser.add_argument(
        "--method",
        action="append",
        choices=("aperture", "size", "inverse"),
        help="fit this one (again for more; default: all three)",
    )
    parser.add_argument("--robust", action="store_true", help="bisquare fits")
    parser.add_argument("--folds", type=int, default=5, metavar="N", help="of the k-fold figures")
    parser.add_argument("--seed", type=int, default=0, help="of the folds")
    parser.add_argument(
        "--exclude",
        action="append",
        default=[],
        metavar="OBJECT_ID",
        help="leave out an object whose truth or box is known to be wrong",
    )
    parser.add_argument(
        "--known-height",
        action="append",
        default=[],
        metavar="TRACK=M",
        help="with --walkers: how tall a track's person is, with shoes; overrides the population",
    )
    parser.add_argument(
        "--known-distance",
        action="append",
        default=[],
        metavar="X,Y,X,Y=M",
        help="with --walkers: how far apart two points on the ground are, given in pixels",
    )
    parser.set_defaults(function=_calibrate)


def _calibrate(arguments: argparse.Namespace) -> int:
    from pipeline.cli.console import out, progress_lines, safe
    from pipeline.core.calibration import Method
    from pipeline.core.config import load_config
    from pipeline.run.calibration import (
        TruthOptions,
        calibrate_stored_blur,
        calibrate_stored_truth,
        calibrate_stored_walkers,
    )
    from pipeline.run.recordings import run
    from pipeline.summary import print_blur_floors, print_calibrations, print_poses

    if arguments.folds < 2:
        raise UsageError("--folds must be at least 2")
    known = _known(arguments)
    if known and not arguments.walkers:
        raise UsageError("--known-height and --known-distance belong to --walkers")
    config = load_config(arguments.camera)
    if arguments.recordings:
        with progress_lines() as report:
            result = run(arguments.recordings, arguments.db, config, report=report)
        for outcome in result.failed:
            raise outcome.error or StadimeterError(f"{outcome.path} could not be read")
    if arguments.walkers and arguments.blur:
        raise UsageError("--walkers and --blur are two calibrations: one after the other")
    if arguments.blur:
        found = print_blur_floors(calibrate_stored_blur(arguments.db, arguments.output, config))
    elif arguments.walkers:
        poses = calibrate_stored_walkers(arguments.db, arguments.output, config, known)
        found = print_poses(poses)
    else:
        options = TruthOptions(
            methods=[Method(m) for m in arguments.method or ("aperture", "size", "inverse")],
            robust=arguments.robust,
            folds=arguments.folds,
            seed=arguments.seed,
            exclude=frozenset(arguments.exclude),
        )
        fitted = calibrate_stored_truth(arguments.db, arguments.output, config, options)
        found = print_calibrations(fitted)
    if found:
        out.print(f"camera file  {safe(arguments.output)}", soft_wrap=True)
    return DONE if found else FAILED


def _known(arguments: argparse.Namespace) -> Known:
    import numpy as np

    from pipeline.calibrate.walkers.known_lengths import Known, KnownDistance, KnownHeight

    heights, distances = [], []
    for text in arguments.known_height:
        try:
            track, _, height = text.partition("=")
            heights.append(KnownHeight(int(track), float(height)))
        except ValueError as error:
            raise UsageError(
                f"--known-height {text!r} is no TRACK=METRES, such as 12=1.80"
            ) from error
    for text in arguments.known_distance:
        try:
            points, _, distance = text.partition("=")
            pixels = np.array([float(v) for v in points.split(",")]).reshape(2, 2)
            distances.append(KnownDistance(pixels, float(distance)))
        except ValueError as error:
            raise UsageError(
                f"--known-distance {text!r} is no X,Y,X,Y=METRES, such as 310,420,505,433=4.2"
            ) from error
    return Known(tuple(heights), tuple(distances))


def _add_estimate(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "estimate",
        help="estimate stored recordings again, with another camera file; reads no image",
    )
    _add_db(parser)
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file")
    parser.add_argument("--label", help="a name for this run, to compare it with others")
    parser.set_defaults(function=_estimate)


def _estimate(arguments: argparse.Namespace) -> int:
    from pipeline.cli.console import out
    from pipeline.core.config import load_config
    from pipeline.run.recordings import estimate_again

    run_id, count = estimate_again(arguments.db, load_config(arguments.camera), arguments.label)
    out.print(f"{arguments.db}: {count:,} recordings estimated again as run {run_id}")
    return DONE


def _add_query(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser("query", help="ask the database in SQL; it cannot be changed")
    parser.add_argument("sql", nargs="?", metavar="SQL")
    _add_db(parser)
    parser.add_argument("--parts", type=Path, metavar="DIR", help="ask a folder of `run --parts`")
    parser.add_argument("--view", metavar="NAME", help="all rows of a view or table")
    parser.add_argument("--list", action="store_true", help="tables and views, what they answer")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--csv", action="store_true")
    form.add_argument("--json", action="store_true")
    form.add_argument("--parquet", type=Path, metavar="FILE")
    parser.set_defaults(function=_query)


def _query(arguments: argparse.Namespace) -> int:
    from pipeline.cli.console import out, print_table, safe
    from pipeline.cli.query import answer, write_csv, write_json, write_parquet

    if sum((arguments.sql is not None, arguments.view is not None, arguments.list)) != 1:
        raise UsageError("give one of SQL, --view NAME or --list")
    table = answer(arguments.db, arguments.sql, arguments.view, arguments.parts)
    if arguments.csv:
        write_csv(table, sys.stdout)
    elif arguments.json:
        write_json(table, sys.stdout)
    elif arguments.parquet:
        write_parquet(table, arguments.parquet)
        out.print(f"{safe(arguments.parquet)}: {table.num_rows:,} rows")
    else:
        print_table(table)
    return DONE


def _add_merge(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser("merge", help="make one database of a folder of `run --parts`")
    parser.add_argument("--parts", type=Path, required=True, metavar="DIR")
    _add_db(parser)
    parser.set_defaults(function=_merge)


def _merge(arguments: argparse.Namespace) -> int:
    from pipeline.cli.console import out, safe
    from pipeline.store.parquet import merge

    count = merge(arguments.parts, arguments.db)
    out.print(f"{safe(arguments.db)}: {count:,} recordings added", soft_wrap=True)
    return DONE


def _add_report(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "report", help="write accuracy, heights and diagnostics as one HTML file"
    )
    _add_db(parser)
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("report.html"), metavar="HTML", help="to write"
    )
    parser.set_defaults(function=_report)


def _report(arguments: argparse.Namespace) -> int:
    from dashboards.report.writer import write_report
    from pipeline.cli.console import out, safe

    write_report(arguments.db, arguments.output)
    out.print(f"report    {safe(arguments.output)}", soft_wrap=True)
    return DONE


def _add_review(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "review", help="look at recordings on a Rerun timeline; several share one clock"
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="file, or its name or id in the database"
    )
    _add_db(parser)
    parser.add_argument(
        "--at", metavar="TIME", help="open there: ISO 8601, seconds from the start, or #frame"
    )
    parser.add_argument("--track", type=int, metavar="ID", help="show this track, and open there")
    parser.add_argument("--track-camera", metavar="NAME", help="the camera of --track or of #frame")
    parser.add_argument("-o", "--output", type=Path, metavar="RRD", help="write it, open nothing")
    parser.add_argument(
        "--browser", action="store_true", help="serve it to a browser, on this machine only"
    )
    _add_preview(parser, "--preview")
    parser.set_defaults(function=_review)


def _review(arguments: argparse.Namespace) -> int:
    from dataclasses import replace

    from dashboards.review.review import Review, elsewhere, open_review, place_for, write_review
    from dashboards.review.viewer import no_display, no_viewer
    from pipeline.cli.console import out, safe
    from pipeline.core.config import Config
    from pipeline.store.database import Store

    config = Config()
    config = replace(config, timeline=_timeline_config(config.timeline, arguments.preview, None))
    review = Review(arguments.recordings, arguments.at, arguments.track, arguments.track_camera)
    hindrance = no_viewer() if arguments.browser else no_display()
    output = arguments.output
    if output is None and hindrance:
        output = Path(f"{Path(arguments.recordings[0]).stem}.review.rrd")
    with place_for(output) as target:
        with Store.open_current(arguments.db) as store:
            written = write_review(store, review, target, config)
        for remark in written.remarks:
            out.print(f"shown     {safe(remark)}", soft_wrap=True)
        if output is None:
            open_review(
                written, lambda line: out.print(line, soft_wrap=True), browser=arguments.browser
            )
            return DONE
        out.print(f"timeline  {safe(output)}", soft_wrap=True)
        if hindrance and arguments.output is None:
            out.print(f"{hindrance}; to look at it:")
            for line in elsewhere(output):
                out.print(f"  {safe(line)}", soft_wrap=True)
    return DONE


def _timeline_config(
    timeline: TimelineConfig, preview_px: int | None, split_minutes: float | None
) -> TimelineConfig:
    """Return how to write timelines: what the command line says goes before the camera file."""
    from dataclasses import replace

    if preview_px is not None:
        if preview_px < 16:
            raise UsageError("a preview needs at least 16 pixels")
        timeline = replace(timeline, preview_px=preview_px)
    if split_minutes is not None:
        if not split_minutes > 0:
            raise UsageError("--rrd-split must be above 0")
        timeline = replace(timeline, split_s=60 * split_minutes)
    return timeline


def _add_preview(parser: argparse.ArgumentParser, name: str) -> None:
    parser.add_argument(
        name,
        type=int,
        metavar="PX",
        help="shrink the timeline's pictures to so many pixels, for small files",
    )


def _add_export(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser(
        "export", help="write a recording with its boxes, objects and estimates added"
    )
    parser.add_argument("recording", type=Path, metavar="RECORDING")
    _add_db(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MCAP")
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file with limits")
    parser.set_defaults(function=_export)


def _export(arguments: argparse.Namespace) -> int:
    from pipeline.cli.console import out, progress_lines, safe
    from pipeline.core.config import load_config
    from pipeline.export.recording import export_recording

    limits = load_config(arguments.camera).limits
    with progress_lines() as report:
        done = export_recording(arguments.recording, arguments.db, arguments.output, limits, report)
    out.print(
        f"{safe(arguments.output)}: {done.messages:,} messages of the original, and "
        f"{done.objects:,} objects in {done.frames:,} frames",
        soft_wrap=True,
    )
    return DAMAGED if done.notes.lost_data else DONE


def _add_demo(commands: Commands[argparse.ArgumentParser]) -> None:
    parser = commands.add_parser("demo", help="run on the recordings that come with the source")
    parser.add_argument("--recordings", type=Path, metavar="DIR", help="where they are")
    parser.add_argument("--out", type=Path, default=Path("out/demo"), metavar="DIR")
    parser.set_defaults(function=_demo)


def _demo(arguments: argparse.Namespace) -> int:
    from pipeline.cli.demo import demo

    return _code_of(*demo(arguments.recordings, arguments.out))


def _add_db(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--db", type=Path, default=DEFAULT_DB, metavar="FILE", help="database")


if __name__ == "__main__":
    sys.exit(main())
