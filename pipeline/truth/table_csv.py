"""Truth in a table: CSV with a header, columns named as in the table `ground_truth`.

    frame_index  or time_s (seconds since the recording's first frame); neither: in every frame
    object_id    name of the object
    class_name   its class (person, if it is left out)
    x_min_px, y_min_px, x_max_px, y_max_px      the box, outer edges; the first pixel's centre is 0
    depth_m, range_m, height_m, width_m, x_m, y_m
    ignored      1 for a region in which boxes do not count

Columns may be left out, and values may be empty. A row with a frame alone says that nobody is there. A
row without a frame gives what is the same in every frame: a height, or a region that is ignored.
"""

from __future__ import annotations

import csv
import io
import math

from pipeline.core.arrays import NAN
from pipeline.core.errors import UsageError
from pipeline.truth.rows import TruthFile, TruthRow

EDGES = ("x_min_px", "y_min_px", "x_max_px", "y_max_px")
SIZES = ("depth_m", "range_m", "height_m", "width_m", "x_m", "y_m")
COLUMNS = ("frame_index", "time_s", "object_id", "class_name", *EDGES, *SIZES, "ignored")
_YES = ("1", "true", "yes")


def read_table(text: str) -> TruthFile:
    """Return the truth of a table.

    Raises:
        UsageError: a column has a name that means nothing here.
    """
    reader = csv.DictReader(io.StringIO(text.lstrip("\ufeff")), skipinitialspace=True)
    names = [name.strip() for name in reader.fieldnames or []]
    unknown = [name for name in names if name not in COLUMNS]
    if unknown:
        raise UsageError(f"unknown column {unknown[0]!r}", remedy=f"Known are {', '.join(COLUMNS)}")
    reader.fieldnames = names
    truth = TruthFile("csv", first_frame=0)
    for row in reader:
        try:
            _add(truth, {k: (v or "").strip() for k, v in row.items() if k})
        except ValueError as error:
            truth.refused.append(f"line {reader.line_num}: {error}")
    return truth


def _add(truth: TruthFile, row: dict[str, str]) -> None:
    frame = int(row["frame_index"]) if row.get("frame_index") else None
    values = {name: _number(row.get(name, ""), name) for name in (*SIZES, "time_s")}
    edges = tuple(_number(row.get(name, ""), name) for name in EDGES)
    known = [e for e in edges if not math.isnan(e)]
    if known and len(known) < 4:
        raise ValueError("a box has four edges")
    box = (edges[0], edges[1], edges[2], edges[3])
    ignored = row.get("ignored", "").lower() in _YES
    name = row.get("object_id", "")
    if not name and not known and all(math.isnan(values[n]) for n in SIZES):
        if frame is None:
            raise ValueError("it says nothing")
        truth.frames.add(frame)
        return
    if not name and not ignored:
        raise ValueError("it has no object_id")
    kind = row.get("class_name") or ("person" if not ignored else None)
    truth.add(TruthRow(frame, name, kind, box, **values), ignored=ignored)


def _number(text: str, name: str) -> float:
    if not text:
        return NAN
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{name} is {text}")
    return value
