"""Files that are there whole or not at all."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.core.errors import StadimeterError, Where


def refuse_special(target: Path, what: str) -> None:
    """Refuse to write onto anything but a file: a device would be replaced by one.

    Raises:
        StadimeterError: the target is a device, a pipe or a folder.
    """
    if not target.exists() or target.is_file():
        return
    kind = "folder" if target.is_dir() else "device or a pipe"
    raise StadimeterError(
        f"{what} cannot be written: this is a {kind}, not a file",
        where=Where(target),
        remedy="Name a file",
    )


def check_folder(folder: Path, what: str) -> None:
    """Make a folder, and see that a file can be written to it.

    Raises:
        StadimeterError: it cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as stream:
            stream.write(b"x")
    except OSError as error:
        raise StadimeterError(
            f"{what} cannot be written there: {error.strerror or error}",
            where=Where(folder),
            remedy="Name a folder that can be written",
        ) from error


@contextmanager
def whole_file(target: Path, what: str) -> Iterator[Path]:
    """Give a path to write to; the file appears under its own name when the block ends well.

    Args:
        target: the file to make, with its folders; one that is there is replaced.
        what: what it is, for the message if it cannot be written.

    Raises:
        StadimeterError: it cannot be written.
    """
    refuse_special(target, what)
    part = target.with_name(f"{target.name}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(target)
    except OSError as error:
        raise StadimeterError(
            f"{what} cannot be written: {error.strerror or error}",
            where=Where(target),
            remedy="Check that there is room on the disk and that the folder can be written",
        ) from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
