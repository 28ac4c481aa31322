"""The pictures of the documentation, made from what `make demo` leaves.

    python -m dashboards.for_docs.pictures out/demo docs     # or: make pictures

Each is a picture of the whole window at a fixed frame, as JPEG below 400 kB. Exit code 1 if a view
complains.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

from dashboards.for_docs.screenshot import viewer
from dashboards.review.viewer import no_driver
from pipeline.core.errors import StadimeterError

LARGEST_BYTES = 350_000


class Shot(NamedTuple):
    """One picture."""

    name: str
    recording: str
    frame: int
    tabs: tuple[str, ...] = ()


SHOTS = (
    Shot("timeline", "street", 132),
    Shot("timeline-errors", "walkers", 100, ("Errors", "Worst errors")),
    Shot("timeline-staff", "staff", 30, ("Exposure", "About")),
)


def take(shot: Shot, demo: Path, target: Path) -> list[str]:
    """Write one picture; return what the views complain of.

    Raises:
        StadimeterError: the viewer does not start, a tab is not there, or the picture is too large.
    """
    with viewer(demo / f"{shot.recording}.rrd") as shown:
        shown.show_frame(shot.frame)
        for tab in shot.tabs:
            shown.show_tab(tab)
        shown.save(target, largest_bytes=LARGEST_BYTES)
        reports = shown.reports()
    if target.stat().st_size > LARGEST_BYTES:
        raise StadimeterError(f"{target} has {target.stat().st_size:,} bytes")
    return reports


def main() -> int:
    """Take all pictures."""
    parser = argparse.ArgumentParser(description="Make the pictures of the documentation.")
    parser.add_argument("demo", type=Path, help="the folder that `make demo` wrote")
    parser.add_argument("target", type=Path, help="where the pictures go")
    arguments = parser.parse_args()
    if no_driver():
        print(no_driver(), file=sys.stderr)
        return 1
    complaints = []
    for shot in SHOTS:
        target = arguments.target / f"{shot.name}.jpg"
        complaints += take(shot, arguments.demo, target)
        print(f"{target}  {target.stat().st_size / 1e3:,.0f} kB")
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
