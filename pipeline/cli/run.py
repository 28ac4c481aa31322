"""`stadimeter run`: measure recordings into a database, or into a folder that machines share."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.console import err, out, print_rows, progress_lines, safe
from pipeline.cli.exit_codes import code_of
from pipeline.cli.options import Commands, add_database, add_preview
from pipeline.cli.summary import print_findings, print_next, print_summary
from pipeline.core.errors import UsageError
from pipeline.detect import CHOICES

if TYPE_CHECKING:
    from stadimeter import RunResult, RunSummary, SharedResult


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser("run", help="measure recordings into a database")
    parser.add_argument(
        "recordings",
        nargs="+",
        type=Path,
        metavar="RECORDING|VIDEO|FOLDER",
        help="MCAP recordings, videos (H.264, H.265, AV1 and VP9 without encoding them anew; needs the "
        "extra `video`), folders of both, patterns such as 'cam*.mp4'",
    )
    add_database(parser)
    parser.add_argument("--rrd", type=Path, metavar="DIR", help="write a Rerun timeline of each")
    add_preview(parser, "--rrd-preview")
    parser.add_argument(
        "--rrd-split",
        type=float,
        metavar="MINUTES",
        help="a timeline for each so many minutes of a recording (default: 60)",
    )
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file")
    parser.add_argument(
        "--videos",
        type=Path,
        metavar="DIR",
        help="folder for the recordings that are made of videos (default: beside the database)",
    )
    parser.add_argument("--detector", choices=CHOICES)
    parser.add_argument(
        "--model",
        type=Path,
        metavar="FILE",
        help="a network (ONNX) that tells which tracks are people; with --detector onnx it finds them",
    )
    parser.add_argument("--model-family", metavar="NAME", help="where its outputs fit several")
    parser.add_argument(
        "--every",
        type=int,
        metavar="N",
        help="measure one of N pictures of each camera; the others are not decoded (of a video they are)",
    )
    parser.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="processes at a time (default: as many as pay, up to one a core); results are the same",
    )
    parser.add_argument(
        "--split",
        type=float,
        default=300.0,
        metavar="S",
        help="cut long recordings into windows of about so many seconds, which are measured side by "
        "side; 0: leave them whole (default: 300)",
    )
    _add_shared(parser)
    parser.add_argument("--label", help="a name for this run, to compare it with others")
    parser.add_argument("--profile", action="store_true", help="print what each stage took")
    told = parser.add_mutually_exclusive_group()
    told.add_argument(
        "-q", "--quiet", action="store_true", help="print warnings and errors only, no results"
    )
    told.add_argument(
        "--json", action="store_true", help="print the results and all warnings as JSON"
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    if arguments.parts is not None:
        return _call_shared(arguments)
    if arguments.engine != "local" or arguments.address is not None:
        raise UsageError("--engine ray needs --parts DIR, a folder that all machines see")
    with progress_lines(quiet=arguments.quiet) as progress:
        result = stadimeter.measure(
            arguments.recordings,
            arguments.db,
            camera=arguments.camera,
            videos=arguments.videos,
            detector=arguments.detector,
            model=arguments.model,
            model_family=arguments.model_family,
            every=arguments.every,
            timelines=arguments.rrd,
            preview_px=arguments.rrd_preview,
            split_minutes=arguments.rrd_split,
            workers=arguments.workers,
            window_s=arguments.split,
            label=arguments.label,
            strict=False,
            progress=progress,
        )
    _print_made(result, quiet=arguments.quiet or arguments.json)
    summary = summary_of(result, arguments.db)
    if arguments.json:
        _print_json(summary, result, arguments.db)
    elif arguments.quiet:
        _print_failures(result)
        print_findings(err, summary.warnings)
    else:
        print_run(result, arguments.db, summary)
    if arguments.profile:
        print_profile(result)
    doubtful = result.damaged or (result.stored if summary.in_doubt else [])
    return code_of(result.stored, result.failed, doubtful)


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


def _call_shared(arguments: argparse.Namespace) -> int:
    import stadimeter

    if arguments.rrd is not None:
        raise UsageError("--rrd needs a database: leave out --parts")
    with progress_lines() as progress:
        result = stadimeter.measure_parts(
            arguments.recordings,
            arguments.parts,
            camera=arguments.camera,
            videos=arguments.videos,
            detector=arguments.detector,
            model=arguments.model,
            model_family=arguments.model_family,
            every=arguments.every,
            engine=arguments.engine,
            address=arguments.address,
            workers=arguments.workers,
            window_s=arguments.split,
            label=arguments.label,
            strict=False,
            progress=progress,
        )
    print_shared(result, arguments.parts)
    return code_of(result.stored, result.failed, result.damaged)


def summary_of(result: RunResult, database: Path) -> RunSummary:
    """Return what a run found, of the recordings that are stored."""
    import stadimeter

    if not result.stored:  # there may be no database at all
        return stadimeter.RunSummary(result.run_id, ())
    ids = [o.recording.recording_id for o in result.stored if o.recording is not None]
    with stadimeter.open(database) as results:
        return stadimeter.summarize(results, result.run_id, ids)


SHOWN_DIGITS = 16  # of the hash of a recording's tables; `recordings` has all of them


def print_run(result: RunResult, database: Path, summary: RunSummary) -> None:
    """Print what came out of a run, what of it is in doubt or lost, and where the results are."""
    print_summary(summary, database)
    _print_failures(result)
    if result.stored:
        out.print(f"database  {safe(database)}", soft_wrap=True)
    for outcome in result.stored:
        if outcome.tables_sha256:
            digest = outcome.tables_sha256[:SHOWN_DIGITS]
            out.print(f"tables    {digest}  {safe(outcome.path.name)}", soft_wrap=True)
    for outcome in result.outcomes:
        for timeline in outcome.timelines:
            out.print(f"timeline  {safe(timeline)}", soft_wrap=True)
    if result.stored:
        print_next(database, summary)
    lost = sum(o.recording.frames_lost for o in result.damaged if o.recording is not None)
    if result.damaged:
        cut = any(finding.code == "truncated_file" for finding in summary.findings)
        least = "at least " if cut else ""
        text = f"{least}{lost:,} frames were lost to damage; the table diagnostics says where"
        out.print(text, style="yellow")


def _print_made(result: RunResult, *, quiet: bool) -> None:
    """Print which recordings were made of videos, and what is doubtful of them."""
    for one in result.made:
        if not quiet:
            how = "made of a video" if one.is_new else "was made of this video before"
            out.print(
                f"recording {safe(one.path)} {how}, {one.frame_count:,} frames", soft_wrap=True
            )
        for remark in one.remarks:
            err.print(f"{safe(one.path.name)}: {safe(remark)}", style="yellow", soft_wrap=True)


def _print_failures(result: RunResult) -> None:
    for outcome in result.failed:
        err.print(f"stadimeter: {safe(outcome.error)}", style="red", soft_wrap=True)


def _print_json(summary: RunSummary, result: RunResult, database: Path) -> None:
    failed = [{"file": str(o.path), "error": str(o.error)} for o in result.failed]
    timelines = [str(path) for o in result.outcomes for path in o.timelines]
    more = {"database": str(database), "failed": failed, "timelines": timelines}
    print(json.dumps(more | summary.as_dict(), indent=2, default=str))


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
        print_rows(title, ("stage", "ms per frame", "share of a processor", "total s"), rows)


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
    for name, note in result.notes:
        err.print(f"{safe(name)}: {safe(note.message)}", style="yellow", soft_wrap=True)
    out.print(f"parts  {safe(folder)}", soft_wrap=True)
