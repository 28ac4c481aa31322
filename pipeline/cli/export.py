"""`stadimeter export`: a copy of a recording with its results added."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, progress_lines, safe
from pipeline.cli.exit_codes import DAMAGED, DONE
from pipeline.cli.options import Commands, add_database


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "export", help="write a recording with its boxes, objects and estimates added"
    )
    parser.add_argument("recording", type=Path, metavar="RECORDING")
    add_database(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MCAP")
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file with limits")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    with progress_lines() as progress:
        done = stadimeter.export(
            arguments.recording,
            arguments.db,
            arguments.output,
            camera=arguments.camera,
            progress=progress,
        )
    out.print(
        f"{safe(arguments.output)}: {done.messages:,} messages of the original, and "
        f"{done.objects:,} objects in {done.frames:,} frames",
        soft_wrap=True,
    )
    return DAMAGED if done.notes.lost_data else DONE
