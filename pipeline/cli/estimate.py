"""`stadimeter estimate`: new estimates of stored recordings; no picture is read."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "estimate",
        help="estimate stored recordings again, with another camera file; reads no image",
    )
    add_database(parser)
    parser.add_argument("--camera", type=Path, metavar="TOML", help="camera file")
    parser.add_argument("--label", help="a name for this run, to compare it with others")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    from pipeline.core.config import load_config
    from pipeline.run.recordings import estimate_again

    run_id, count = estimate_again(arguments.db, load_config(arguments.camera), arguments.label)
    out.print(f"{arguments.db}: {count:,} recordings estimated again as run {run_id}")
    return DONE
