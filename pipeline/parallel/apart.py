"""One call in a process of its own, for libraries that end their process where a file is broken.

The child is a new Python (`python -m`), so nothing of the caller's main module is run again.
"""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from pipeline.core.errors import StadimeterError

_REPORT, _RESULT, _ERROR = "report", "result", "error"


class Died(StadimeterError):
    """A process that ended without a result; `problem` says how."""


def call_apart(
    function: Callable[..., Any], *arguments: object, report: Callable[[Any], None]
) -> Any:
    """Return what `function(*arguments, report)` returns in another process.

    Args:
        function: one of a module, by whose name the child finds it.
        arguments: they are pickled.
        report: is called here with what the function reports there.

    Raises:
        Died: the process ended without a result.
        StadimeterError: the function raised it.
    """
    here, there = Pipe()
    with (
        here,
        tempfile.TemporaryFile() as said,
        subprocess.Popen(  # noqa: S603  (this very Python)
            [sys.executable, "-m", __name__, str(there.fileno())],
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=said,
            pass_fds=[there.fileno()],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        ) as child,
    ):
        there.close()  # so that its end is seen here
        try:
            here.send((function.__module__, function.__qualname__, arguments, sys.path))
            return _heard(here, report)
        except (EOFError, OSError):
            code = child.wait()
            said.seek(0)
            raise Died(_how(code, said.read()[-2000:])) from None
        finally:
            child.kill()


def _heard(connection: Connection, report: Callable[[Any], None]) -> Any:
    while True:
        kind, content = connection.recv()
        if kind == _RESULT:
            return content
        if kind == _ERROR:
            raise content
        report(content)


def _how(code: int, said: bytes) -> str:
    if code < 0:
        try:
            how = f"ended by signal {signal.Signals(-code).name}"
        except ValueError:
            how = f"ended by signal {-code}"
    else:
        how = f"ended with exit code {code}"
    lines = said.decode("utf-8", "replace").strip().splitlines()
    return f"{how} ({lines[-1].strip()[:200]})" if lines else how


def _main() -> None:
    connection = Connection(int(sys.argv[1]))
    module, name, arguments, path = connection.recv()
    sys.path[:] = path
    function = getattr(importlib.import_module(module), name)
    try:
        result = function(*arguments, lambda content: connection.send((_REPORT, content)))
    except StadimeterError as error:
        connection.send((_ERROR, error))
    else:
        connection.send((_RESULT, result))


if __name__ == "__main__":
    _main()
