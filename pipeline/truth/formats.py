"""Files of truth: which form one has, and its rows. A new form is a reader, and a row in `FORMS`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from pipeline.core.errors import UsageError, Where
from pipeline.truth.numbers_in_lines import read_kitti, read_mot
from pipeline.truth.rows import TruthFile
from pipeline.truth.table_csv import read_table
from pipeline.truth.trees import read_coco, read_cvml

FORMS: dict[str, Callable[[str], TruthFile]] = {
    "mot": read_mot,
    "kitti": read_kitti,
    "cvml": read_cvml,
    "coco": read_coco,
    "csv": read_table,
}
MOST_BYTES = 256 * 1024**2  # a day of boxes by hand is a tenth of that


def read_truth(path: Path, form: str = "auto") -> TruthFile:
    """Return the truth of a file.

    Args:
        path: the file.
        form: one of `FORMS`, or auto: by its content.

    Raises:
        UsageError: it cannot be read, is of no known form, or holds nothing.
    """
    text = _text(path)
    name = recognise(text) if form == "auto" else form
    if name not in FORMS:
        raise UsageError(
            "its form is not recognised" if form == "auto" else f"unknown form {form!r}",
            where=Where(path),
            remedy=f"Known are {', '.join(FORMS)}; --format NAME says which",
        )
    try:
        truth = FORMS[name](text)
    except UsageError as error:
        raise UsageError(error.problem, where=Where(path), remedy=error.remedy) from error
    if not truth.objects and not truth.ignored and not truth.frames:
        why = f": {truth.refused[0]}" if truth.refused else ""
        raise UsageError(
            f"it holds no truth as {name}{why}",
            where=Where(path),
            remedy="--format NAME says which form it has: " + ", ".join(FORMS),
        )
    return truth


def recognise(text: str) -> str:
    """Return the form that a text has by its beginning; empty if none."""
    start = text.lstrip("\ufeff \t\r\n")[:4000]
    if start.startswith("<"):
        return "cvml"
    if start.startswith("{"):
        return "coco"
    line = start.partition("\n")[0].strip()
    fields = line.replace(",", " ").split()
    if "," in line and any(f in ("object_id", "frame_index", "time_s") for f in fields):
        return "csv"
    if len(fields) in (17, 18) and fields[2].isalpha():
        return "kitti"
    try:
        return "mot" if len([float(f) for f in fields]) >= 6 else ""
    except ValueError:
        return ""


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise UsageError(f"it is larger than {MOST_BYTES >> 20} MB", where=Where(path))
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise UsageError(f"cannot be read: {error.strerror}", where=Where(path)) from error
    except UnicodeDecodeError as error:
        raise UsageError(f"it is no text: {error.reason}", where=Where(path)) from error
