"""The command `stadimeter`: arguments in, messages and exit codes out. The work is elsewhere."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from pipeline.cli import (
    calibrate,
    demo,
    estimate,
    export,
    import_,
    inspect,
    merge,
    models,
    query,
    review,
    run,
    runs,
    truth,
    verify,
)
from pipeline.cli.console import err, safe, stdout_is_closed
from pipeline.cli.exit_codes import DONE, FAILED, INTERRUPTED, USAGE
from pipeline.cli.pages import report, statement
from pipeline.core.errors import StadimeterError, UsageError

# In the order of the help. Each has `add`, which adds its arguments, and `call`.
COMMANDS = (
    run,
    inspect,
    import_,
    calibrate,
    estimate,
    truth,
    models,
    query,
    runs,
    merge,
    report,
    statement,
    export,
    review,
    verify,
    demo,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code."""
    parser = build_parser()
    arguments = parser.parse_args(argv)
    if arguments.command is None:
        parser.print_help()
        return USAGE
    if stdout_is_closed:
        err.print("stadimeter: standard output is closed; redirect it to a file or to /dev/null")
        return FAILED
    try:
        code: int = arguments.function(arguments)
        sys.stdout.flush()  # a full disk says so here, and not when nobody listens any more
    except StadimeterError as error:
        if arguments.debug:
            raise
        err.print(f"stadimeter: {safe(error)}", soft_wrap=True)
        return USAGE if isinstance(error, UsageError) else FAILED
    except BrokenPipeError:  # `stadimeter query ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        if arguments.debug:
            raise
        name = f"{error.filename}: " if error.filename is not None else ""
        err.print(f"stadimeter: {safe(name)}{error.strerror or error}", soft_wrap=True)
        return FAILED
    except KeyboardInterrupt:
        print("stadimeter: interrupted; what was committed is kept", file=sys.stderr)
        return INTERRUPTED
    return code


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with all commands."""
    from pipeline import __version__

    parser = argparse.ArgumentParser(
        prog="stadimeter",
        description="Distances and heights, with intervals, of what recorded footage shows.",
    )
    parser.add_argument("-V", "--version", action="version", version=f"stadimeter {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    for command in COMMANDS:
        command.add(commands)
    for one in commands.choices.values():
        one.add_argument("--debug", action="store_true", help="show tracebacks")
    return parser
