"""`stadimeter merge`: one database made of a folder of finished recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser("merge", help="make one database of a folder of `run --parts`")
    parser.add_argument("--parts", type=Path, required=True, metavar="DIR")
    add_database(parser)
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    count = stadimeter.merge(arguments.parts, arguments.db)
    out.print(f"{safe(arguments.db)}: {count:,} recordings added", soft_wrap=True)
    return DONE
