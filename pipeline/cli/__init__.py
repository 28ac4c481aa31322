"""The command line: `main` reads the arguments, and each command is a file of its own."""

from pipeline.cli.main import main

__all__ = ["main"]
