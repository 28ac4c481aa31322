"""`stadimeter estimate`: new estimates of stored recordings; no picture is read."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, safe
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
    import stadimeter

    done = stadimeter.estimate(arguments.db, camera=arguments.camera, label=arguments.label)
    out.print(
        f"{safe(arguments.db)}: {done.recording_count:,} recordings estimated again as run "
        f"{done.run_id}"
    )
    return DONE
