"""`stadimeter run`: measure recordings into a database, or into a folder that machines share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.console import err, out, print_rows, progress_lines, safe
from pipeline.cli.exit_codes import code_of
from pipeline.cli.options import Commands, add_database, add_preview
from pipeline.core.errors import UsageError
from pipeline.detect import CHOICES

if TYPE_CHECKING:
    from stadimeter import Results, RunResult, SharedResult


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser("run", help="measure recordings into a database")
    parser.add_argument("recordings", nargs="+", type=Path, metavar="RECORDING")
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
    parser.add_argument("--detector", choices=CHOICES)
    parser.add_argument("--model", type=Path, metavar="FILE", help="the network of onnx")
    parser.add_argument("--model-family", metavar="NAME", help="where its outputs fit several")
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="processes")
    _add_shared(parser)
    parser.add_argument("--label", help="a name for this run, to compare it with others")
    parser.add_argument("--profile", action="store_true", help="print what each stage took")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    if arguments.parts is not None:
        return _call_shared(arguments)
    if arguments.engine != "local" or arguments.address is not None:
        raise UsageError("--engine ray needs --parts DIR, a folder that all machines see")
    with progress_lines() as progress:
        result = stadimeter.measure(
            arguments.recordings,
            arguments.db,
            camera=arguments.camera,
            detector=arguments.detector,
            model=arguments.model,
            model_family=arguments.model_family,
            timelines=arguments.rrd,
            preview_px=arguments.rrd_preview,
            split_minutes=arguments.rrd_split,
            workers=arguments.workers,
            label=arguments.label,
            strict=False,
            progress=progress,
        )
    print_run(result, arguments.db)
    if arguments.profile:
        print_profile(result)
    return code_of(result.stored, result.failed, result.damaged)


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


def _call_shared(arguments: argparse.Namespace) -> int:
    import stadimeter

    if arguments.rrd is not None:
        raise UsageError("--rrd needs a database: leave out --parts")
    with progress_lines() as progress:
        result = stadimeter.measure_parts(
            arguments.recordings,
            arguments.parts,
            camera=arguments.camera,
            detector=arguments.detector,
            model=arguments.model,
            model_family=arguments.model_family,
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
    if result.stored:
        out.print(f"database  {safe(database)}", soft_wrap=True)
    for outcome in result.outcomes:
        for timeline in outcome.timelines:
            out.print(f"timeline  {safe(timeline)}", soft_wrap=True)
    if result.damaged:
        import stadimeter

        with stadimeter.open(database) as results:
            print_damage(results, result.run_id)
            least = "at least " if ends_are_missing(results, result.run_id) else ""
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
    out.print(f"parts  {safe(folder)}", soft_wrap=True)


def print_damage(results: Results, run_id: str) -> None:
    """Print the first diagnostics of a run that say what was lost."""
    found = results.query(
        "SELECT file_name, byte_offset, topic, count, message FROM diagnostics "
        "WHERE run_id = ? AND severity = 'error'",
        [run_id],
    ).rows()
    for row in found[:MAX_SHOWN]:
        place = f" byte {row['byte_offset']:,}" if row["byte_offset"] is not None else ""
        topic = f" {row['topic']}" if row["topic"] else ""
        times = f" ({row['count']:,} times)" if row["count"] > 1 else ""
        out.print(f"  {safe(row['file_name'])}{place}{safe(topic)}: {safe(row['message'])}{times}")
    if len(found) > MAX_SHOWN:
        out.print(f"  and {len(found) - MAX_SHOWN:,} more")


def ends_are_missing(results: Results, run_id: str) -> bool:
    """Return True if a recording of a run was cut, so that its end is unknown."""
    found = results.query(
        "FROM diagnostics WHERE run_id = ? AND code = 'truncated_file' LIMIT 1", [run_id]
    )
    return len(found) > 0
