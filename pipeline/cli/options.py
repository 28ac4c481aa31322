"""Options that several commands share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TypeAlias

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
