"""`stadimeter report`: accuracy, heights and diagnostics as one HTML file."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "report", help="write accuracy, heights and diagnostics as one HTML file"
    )
    add_database(parser)
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("report.html"), metavar="HTML", help="to write"
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    path = stadimeter.report(arguments.db, arguments.output)
    out.print(f"report    {safe(path)}", soft_wrap=True)
    return DONE
