"""`stadimeter review`: recordings on a Rerun timeline, in a window, a browser or a file."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database, add_preview, timeline_config


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
    from dataclasses import replace

    from dashboards.review.review import Review, elsewhere, open_review, place_for, write_review
    from dashboards.review.viewer import no_display, no_viewer
    from pipeline.core.config import Config
    from pipeline.store.database import Store

    config = Config()
    config = replace(config, timeline=timeline_config(config.timeline, arguments.preview, None))
    review = Review(arguments.recordings, arguments.at, arguments.track, arguments.track_camera)
    hindrance = no_viewer() if arguments.browser else no_display()
    output = arguments.output
    if output is None and hindrance:
        output = Path(f"{Path(arguments.recordings[0]).stem}.review.rrd")
    with place_for(output) as target:
        with Store.open_current(arguments.db) as store:
            written = write_review(store, review, target, config)
        for remark in written.remarks:
            out.print(f"shown     {safe(remark)}", soft_wrap=True)
        if output is None:
            open_review(
                written, lambda line: out.print(line, soft_wrap=True), browser=arguments.browser
            )
            return DONE
        out.print(f"timeline  {safe(output)}", soft_wrap=True)
        if hindrance and arguments.output is None:
            out.print(f"{hindrance}; to look at it:")
            for line in elsewhere(output):
                out.print(f"  {safe(line)}", soft_wrap=True)
    return DONE
