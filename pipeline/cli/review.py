"""`stadimeter review`: recordings on a Rerun timeline, in a window, a browser or a file."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database, add_preview


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "review", help="look at recordings on a Rerun timeline; several share one clock"
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="file, or its name or id in the database"
    )
    add_database(parser)
    parser.add_argument(
        "--at", metavar="TIME", help="open there: ISO 8601, seconds from the start, or #frame"
    )
    parser.add_argument("--track", type=int, metavar="ID", help="show this track, and open there")
    parser.add_argument("--track-camera", metavar="NAME", help="the camera of --track or of #frame")
    parser.add_argument("-o", "--output", type=Path, metavar="RRD", help="write it, open nothing")
    parser.add_argument(
        "--browser", action="store_true", help="serve it to a browser, on this machine only"
    )
    add_preview(parser, "--preview")
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    done = stadimeter.review(
        arguments.recordings,
        arguments.db,
        output=arguments.output,
        at=arguments.at,
        track=arguments.track,
        track_camera=arguments.track_camera,
        browser=arguments.browser,
        preview_px=arguments.preview,
        say=_say,
    )
    if done.path is None:
        return DONE
    for remark in done.remarks:
        _say(f"shown     {remark}")
    _say(f"timeline  {done.path}")
    if done.hindrance:
        _say(f"{done.hindrance}; to look at it:")
        for line in done.hints:
            _say(f"  {line}")
    return DONE


def _say(line: str) -> None:
    out.print(safe(line), soft_wrap=True)
