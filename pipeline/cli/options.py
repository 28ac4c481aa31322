"""Options that several commands share."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from pipeline.core.errors import UsageError

if TYPE_CHECKING:
    from pipeline.core.config import TimelineConfig

# The type has no public name, and its parameter is known to type checkers only.
Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"

DEFAULT_DATABASE = Path("stadimeter.duckdb")


def add_database(parser: argparse.ArgumentParser) -> None:
    """Add `--db`."""
    parser.add_argument(
        "--db", type=Path, default=DEFAULT_DATABASE, metavar="FILE", help="database"
    )


def add_preview(parser: argparse.ArgumentParser, name: str) -> None:
    """Add an option that shrinks the pictures of timelines."""
    parser.add_argument(
        name,
        type=int,
        metavar="PX",
        help="shrink the timeline's pictures to so many pixels, for small files",
    )


def timeline_config(
    timeline: TimelineConfig, preview_px: int | None, split_minutes: float | None
) -> TimelineConfig:
    """Return how to write timelines: options override the camera file."""
    if preview_px is not None:
        if preview_px < 16:
            raise UsageError("a preview needs at least 16 pixels")
        timeline = replace(timeline, preview_px=preview_px)
    if split_minutes is not None:
        if not split_minutes > 0:
            raise UsageError("--rrd-split must be above 0")
        timeline = replace(timeline, split_s=60 * split_minutes)
    return timeline
