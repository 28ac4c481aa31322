"""`stadimeter verify`: whether files and numbers are still what was stored."""

from __future__ import annotations

import argparse

from pipeline.cli.console import err, out, progress_lines, safe
from pipeline.cli.exit_codes import DONE, FAILED
from pipeline.cli.options import Commands, add_database


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "verify", help="hash the recordings of a database again, measure some frames again, compare"
    )
    add_database(parser)
    parser.add_argument(
        "--frames",
        type=int,
        default=20,
        metavar="N",
        help="compare N frames of each recording, drawn at random; 0: hash the files only",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the draw")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    with progress_lines() as progress:
        found = stadimeter.verify(
            arguments.db, frames=arguments.frames, seed=arguments.seed, progress=progress
        )
    for one in found:
        if one.problem:
            err.print(f"stadimeter: {safe(one.file_name)}: {safe(one.problem)}", soft_wrap=True)
        else:
            text = "the file is unchanged"
            if one.frames_compared:
                text += f"; measured again, {one.frames_compared:,} frames have equal rows"
            if one.all_rows_equal:
                text += ", and so do all others (the hash of all tables)"
            out.print(f"{safe(one.file_name)}: {text}", soft_wrap=True)
    return FAILED if any(one.problem for one in found) else DONE
