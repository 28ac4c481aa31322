"""Files that are there whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.core.errors import StadimeterError, Where


@contextmanager
def whole_file(target: Path, what: str) -> Iterator[Path]:
    """Give a path to write to; the file appears under its own name when the block ends well.

    Args:
        target: the file to make, with its folders; one that is there is replaced.
        what: what it is, for the message if it cannot be written.

    Raises:
        StadimeterError: it cannot be written.
    """
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
