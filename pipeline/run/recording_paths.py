"""Recordings that a user names: files, folders and patterns become files and bags."""

from __future__ import annotations

import glob
import os
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path

from pipeline.core.errors import UsageError, Where

BAG = "metadata.yaml"  # beside the files of one recording
SUFFIX = ".mcap"
_OTHERS = (".db3", ".bag", ".zstd", ".zst")


def recordings_of(given: Iterable[Path], also: Collection[str] = ()) -> list[Path]:
    """Return the recordings that are named, each once: files, and folders of bags.

    A folder is searched at any depth; a folder with a metadata.yaml is one recording. Where all files
    of a bag are named, they are that bag. A path that does not exist is kept if it is no pattern.

    Args:
        given: what a user names.
        also: suffixes of other files that are looked for in folders, in small letters: `.mp4`.

    Raises:
        UsageError: a folder holds no recording, or a pattern fits nothing.
    """
    found = dict.fromkeys(path for one in given for path in _of_one(one, also))
    return _bags_of(list(found))


def _of_one(path: Path, also: Collection[str]) -> Iterator[Path]:
    if path.is_dir():
        yield from _in_folder(path, also)
    elif glob.has_magic(str(path)) and not path.exists():
        fitting = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207
        if not fitting:
            raise UsageError("no file fits this pattern", where=Where(path))
        for name in fitting:
            if Path(name).is_dir():
                yield from _in_folder(Path(name), also, required=False)
            else:
                yield Path(name)
    else:
        yield path


def _in_folder(folder: Path, also: Collection[str], *, required: bool = True) -> Iterator[Path]:
    if (folder / BAG).is_file():
        yield folder
        return
    found, others = [], set()
    for place, folders, names in os.walk(folder):
        if BAG in names and Path(place) != folder:
            folders.clear()
            found.append(Path(place))
            continue
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in names:
            suffix = Path(name).suffix.lower()
            if (suffix == SUFFIX or suffix in also) and not name.startswith("."):
                found.append(Path(place) / name)
            elif suffix in _OTHERS:
                others.add(suffix)
    if not found and required:
        there = f" (there are {', '.join(sorted(others))} files)" if others else ""
        raise UsageError(
            f"the folder holds no {SUFFIX} file{' and no video' if also else ''}{there}",
            where=Where(folder),
            remedy="Name recordings, or a folder of them"
            + ("; convert others with `mcap convert` or `ros2 bag convert`" if others else ""),
        )
    yield from sorted(found)


def _bags_of(paths: list[Path]) -> list[Path]:
    """Return paths in which files that are all those of a bag became the bag."""
    by_folder: dict[Path, list[Path]] = {}
    for path in paths:
        if path.suffix.lower() == SUFFIX and (path.parent / BAG).is_file():
            by_folder.setdefault(path.parent, []).append(path)
    bags = {
        folder
        for folder, named in by_folder.items()
        if len(named) > 1
        and {p.name for p in named} == {p.name for p in folder.iterdir() if p.suffix == SUFFIX}
    }
    whole = {path: path.parent for path in paths if path.parent in bags and path.suffix == SUFFIX}
    return list(dict.fromkeys(whole.get(path, path) for path in paths))


def folders_apart(paths: Iterable[Path], folder: Path) -> dict[Path, Path]:
    """Return a folder for the output of each recording, in which no two have the same name.

    Args:
        paths: the recordings.
        folder: where all output goes; recordings of one name go into folders below it that are
            named as theirs are.
    """
    by_name: dict[str, list[Path]] = {}
    for path in paths:
        by_name.setdefault(path.stem.casefold(), []).append(path)
    found: dict[Path, Path] = {}
    for same in by_name.values():
        if len(same) == 1:
            found[same[0]] = folder
            continue
        parents = [path.absolute().parent for path in same]
        common = Path(os.path.commonpath(parents))
        seen: set[Path] = set()
        for path, parent in zip(same, parents, strict=True):
            below = folder / parent.relative_to(common)
            if below in seen:  # one name in one folder: `a.mcap` and the bag `a`
                below = below / path.name
            seen.add(below)
            found[path] = below
    return found
