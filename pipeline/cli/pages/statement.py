"""`stadimeter statement`: the sheet on one person or pair that is handed in."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "statement",
        help="write the height and distance of one person as a page for print, with its uncertainty",
    )
    add_database(parser)
    parser.add_argument("--track", type=int, required=True, metavar="N", help="the person's track")
    parser.add_argument("--recording", metavar="NAME", help="recording, if several have this track")
    parser.add_argument("--camera-name", metavar="NAME", help="camera, if several have this track")
    group = parser.add_mutually_exclusive_group()
    group.add_argument(
        "--against",
        type=int,
        metavar="N",
        help="track of another person: the difference of heights",
    )
    group.add_argument(
        "--reference-height",
        type=float,
        metavar="M",
        help="a stated stature in metres: how the measurement goes with it",
    )
    parser.add_argument(
        "--marks",
        type=Path,
        metavar="CSV",
        help="heads and feet marked by hand, which count instead",
    )
    parser.add_argument(
        "--marks-page",
        type=Path,
        metavar="HTML",
        help="write a page for marking heads and feet, and no statement",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="HTML", help="to write (default: statement-N.html)"
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    which = {"recording": arguments.recording, "camera": arguments.camera_name}
    if arguments.marks_page is not None:
        path = stadimeter.marks_page(arguments.db, arguments.track, arguments.marks_page, **which)
        out.print(
            f"marks     {safe(path)}: open it in a browser, and save marks.csv", soft_wrap=True
        )
        return DONE
    path = stadimeter.statement(
        arguments.db,
        arguments.track,
        arguments.output or Path(f"statement-{arguments.track}.html"),
        against=arguments.against,
        reference_height_m=arguments.reference_height,
        marks=arguments.marks,
        **which,
    )
    out.print(
        f"statement {safe(path)}: open it in a browser; print it to PDF there", soft_wrap=True
    )
    return DONE
