"""`stadimeter runs`: the runs of a database; which are kept, removed, and which one counts."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from pipeline.cli.console import out, print_rows, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands, add_database
from pipeline.core.errors import UsageError

ACTIONS = ("list", "current", "keep", "release", "remove")


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "runs", help="list the runs of a database; choose, keep or remove one"
    )
    parser.add_argument(
        "action",
        nargs="?",
        choices=ACTIONS,
        default="list",
        help="list all; let NAME count (current); do not let the same settings replace it (keep, "
        "undone by release); remove it (default: list)",
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="label or id of a run")
    add_database(parser)
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    import stadimeter

    action, name, db = arguments.action, arguments.name, arguments.db
    if (action == "list") != (name is None):
        raise UsageError(
            f"runs {action} takes {'no name' if action == 'list' else 'the name of a run'}",
            remedy="`stadimeter runs` lists them",
        )
    if action == "list":
        _print(stadimeter.runs(db).arrow().to_pylist())
    elif action == "current":
        _tell("counts now", stadimeter.make_current(db, name))
    elif action == "remove":
        _tell("is removed", stadimeter.remove_run(db, name))
    else:
        keep = action == "keep"
        said = "is kept" if keep else "may be replaced"
        _tell(said, stadimeter.keep_run(db, name, keep=keep))
    return DONE


def _tell(said: str, rows: Sequence[dict[str, Any]]) -> None:
    for row in rows:
        out.print(
            f"{safe(row['run_label'] or row['run_id'])} {said}: {safe(row['file_name'])}",
            soft_wrap=True,
        )


def _print(rows: Sequence[dict[str, Any]]) -> None:
    header = ("run", "label", "command", "started", "version", "recording", "state", "kept")
    print_rows("Runs", header, [_cells(row) for row in rows])


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    started = row["started_at"]
    state = "current" if row["is_current"] else "aside" if row["is_kept_aside"] else "earlier"
    return (
        row["run_id"],
        row["run_label"] or "",
        row["command"] or "",
        f"{started:%Y-%m-%d %H:%M:%S}" if started else "",
        row["software_version"] or "",
        row["file_name"],
        state,
        "yes" if row["keep"] else "",
    )
