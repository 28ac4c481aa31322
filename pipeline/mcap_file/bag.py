"""Bags of ROS 2: folders whose metadata.yaml lists the files of one recording, read as one.

A recorder that splits a bag writes what holds for all of it (the calibration, transforms) into the first
file only. Behind each other the files are what `cat` makes of them, which the format allows.
"""

from __future__ import annotations

import hashlib
import io
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any

from pipeline.core.errors import NotARecording, Where

METADATA = "metadata.yaml"
_LARGEST_METADATA = 16 * 1024**2
_BLOCK = 1 << 20
_KEY, _ENTRY = "relative_file_paths:", "- "


def listed_files(folder: Path) -> list[Path]:
    """Return the files that the metadata of a bag lists, in their order; none if it is no bag."""
    try:
        with (folder / METADATA).open(encoding="utf-8", errors="replace") as stream:
            lines = stream.read(_LARGEST_METADATA).splitlines()
    except OSError:
        return []
    files, inside = [], False
    for line in lines:
        text = line.strip()
        if text.startswith(_KEY):
            inside = True
            if (rest := text.removeprefix(_KEY).strip()).startswith("["):
                return [
                    _inside(folder, name) for name in rest.strip("[]").split(",") if name.strip()
                ]
        elif inside and text.startswith(_ENTRY):
            files.append(_inside(folder, text.removeprefix(_ENTRY)))
        elif inside and text:
            break
    return files


def _inside(folder: Path, stated: str) -> Path:
    """Return a file of a bag; a bag that was copied keeps its files beside the metadata."""
    name = stated.strip().strip("'\"")
    found = folder / name
    return found if found.exists() else folder / Path(name).name


def parts_of(path: Path) -> list[Path]:
    """Return the files of a recording that are there: itself, or those of a bag.

    Raises:
        NotARecording: a folder is no bag of MCAP files.
    """
    if not path.is_dir():
        return [path]
    listed = listed_files(path)
    where = Where(path)
    if not listed:
        raise NotARecording(
            "a folder is no recording, unless it is a bag with metadata.yaml",
            where=where,
            remedy="Name the .mcap files in it",
        )
    refuse_other_storage(listed, where)
    there = [part for part in listed if part.is_file()]
    if not there:
        names = ", ".join(part.name for part in listed[:5])
        raise NotARecording(
            f"none of the files that {METADATA} lists is there ({names})",
            where=where,
            remedy="Copy them into the folder, or remove metadata.yaml and name the .mcap files",
        )
    return there


def is_recording(path: Path) -> bool:
    """Return whether there is a file, or a bag, at a path."""
    return path.is_file() or (path.is_dir() and bool(listed_files(path)))


def found_at(path: Path, folder: Path) -> Path | None:
    """Return where a recording is: at its path, or by the folder of the database that names it."""
    places = (path, folder / path, folder / path.name, Path(path.name))
    return next((place for place in places if is_recording(place)), None)


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of the bytes of a recording, in hexadecimal digits."""
    digest = hashlib.sha256()
    with open_bytes(path) as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def missing_parts(path: Path) -> list[str]:
    """Return the names of the files of a bag that are not there."""
    if not path.is_dir():
        return []
    return [part.name for part in listed_files(path) if not part.is_file()]


def refuse_other_storage(files: Sequence[Path], where: Where) -> None:
    """Refuse files that are no MCAP by their names, and say how to make one of them.

    Raises:
        NotARecording: one of them is an sqlite3 bag, a bag of ROS 1, or compressed as a whole.
    """
    for file in files:
        suffix = file.suffix.lower()
        if suffix == ".db3":
            raise NotARecording(
                "a bag that was recorded with sqlite3 is not read",
                where=where,
                remedy="Convert it with `ros2 bag convert` to storage_id mcap, or with `mcap convert`",
            )
        if suffix == ".bag":
            raise NotARecording(
                "a bag of ROS 1 is not read", where=where, remedy="Convert it with `mcap convert`"
            )
        if suffix in (".zstd", ".zst", ".lz4", ".gz"):
            raise NotARecording(
                f"{file.name} is compressed as a whole, which is not read",
                where=where,
                remedy="Unpack it first; chunks that are compressed inside of an MCAP are read",
            )


def size_of(path: Path) -> int:
    """Return the size of a recording in bytes: of all its files."""
    return sum(part.stat().st_size for part in parts_of(path))


def open_bytes(path: Path, *, buffered: bool = True) -> Any:
    """Open the bytes of a recording: of a file, or of the files of a bag behind each other.

    Raises:
        NotARecording: a folder is no bag of MCAP files.
        OSError: a file cannot be opened.
    """
    parts = parts_of(path)
    if len(parts) == 1:
        return parts[0].open("rb") if buffered else parts[0].open("rb", buffering=0)
    joined = JoinedFiles(parts)
    return io.BufferedReader(joined) if buffered else joined


class JoinedFiles(io.RawIOBase):
    """The bytes of files behind each other."""

    def __init__(self, parts: Sequence[Path]) -> None:
        super().__init__()
        self._parts = list(parts)
        self._ends = list(accumulate(part.stat().st_size for part in parts))
        self._open: tuple[int, io.FileIO] | None = None
        self._at = 0

    def readable(self) -> bool:
        """Return True."""
        return True

    def seekable(self) -> bool:
        """Return True."""
        return True

    def tell(self) -> int:
        """Return the offset in all files."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to an offset in all files; return it."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._ends[-1]}[whence]
        self._at = max(start + offset, 0)
        return self._at

    def readinto(self, buffer: Any) -> int:
        """Read as much as one of the files has; 0 at the end of the last."""
        number = bisect_right(self._ends, self._at)
        if number == len(self._parts):
            return 0
        start = self._ends[number - 1] if number else 0
        view = memoryview(buffer).cast("B")[: self._ends[number] - self._at]
        stream = self._part(number)
        stream.seek(self._at - start)
        count = stream.readinto(view) or 0
        self._at += count
        return count

    def close(self) -> None:
        """Close the file that is open."""
        if self._open is not None:
            self._open[1].close()
        super().close()

    def _part(self, number: int) -> io.FileIO:
        if self._open is None or self._open[0] != number:
            if self._open is not None:
                self._open[1].close()
            self._open = number, io.FileIO(self._parts[number])
        return self._open[1]
