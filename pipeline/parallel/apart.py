"""One call in a process of its own, for libraries that end their process where a file is broken.

The child is a new Python (`python -m`), so nothing of the caller's main module is run again.
"""

from __future__ import annotations

import importlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from typing import Any, BinaryIO

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
    task = pickle.dumps((function.__module__, function.__qualname__, arguments, sys.path))
    with (
        tempfile.TemporaryFile() as said,
        subprocess.Popen(  # noqa: S603  (this very Python)
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=said,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        ) as child,
    ):
        assert child.stdin is not None and child.stdout is not None  # noqa: S101, PT018
        try:
            with child.stdin as stdin:
                stdin.write(task)
            return _heard(child.stdout, report)
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            code = child.wait()
            said.seek(0)
            raise Died(_how(code, said.read()[-2000:])) from None
        finally:
            child.kill()


def _heard(stream: BinaryIO | Any, report: Callable[[Any], None]) -> Any:
    while True:
        kind, content = pickle.load(stream)  # noqa: S301  (our own child)
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
    # Libraries print what they like; the results have a way of their own.
    results = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    def send(kind: str, content: object) -> None:
        results.write(pickle.dumps((kind, content)))
        results.flush()

    module, name, arguments, path = pickle.load(sys.stdin.buffer)  # noqa: S301  (our own parent)
    sys.path[:] = path
    function = getattr(importlib.import_module(module), name)
    try:
        result = function(*arguments, lambda content: send(_REPORT, content))
    except StadimeterError as error:
        send(_ERROR, error)
    else:
        send(_RESULT, result)


if __name__ == "__main__":
    _main()
