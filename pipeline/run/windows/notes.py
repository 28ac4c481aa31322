"""Diagnostics of the windows of a recording as one: each time counts once, an absence is that of all."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from pipeline.core.tables import DIAGNOSTICS
from pipeline.run.windows.split import Window

# Notes that something is absent: true of a recording if they are true of all its windows. The messages of
# the first two list what else is there, which may differ from window to window.
_ABSENCES = ("no_images", "unmatched_camera", "unmatched_exposure")


def stitched_notes(
    folders: Sequence[Path], windows: Sequence[Window], cameras: pa.Table
) -> pa.Table:
    """Return the diagnostics of the time that counts; equal ones of several windows become one.

    Args:
        folders: the parts of each window.
        windows: the windows, in order.
        cameras: the stitched table of cameras.
    """
    rows = []
    for folder, window in zip(folders, windows, strict=True):
        table = pq.read_table(folder / "diagnostics.parquet")
        said = table.to_pandas(types_mapper=pd.ArrowDtype)
        time_ns = said["log_time_ns"]
        rows.append(said[time_ns.isna() | ((time_ns >= window.from_ns) & (time_ns < window.to_ns))])
    rows = _without_partial_absences(rows, cameras)
    every = pd.concat(rows, ignore_index=True)
    if not len(every):
        return DIAGNOSTICS.empty_table()
    key = ["severity", "code", "message", "camera", "topic"]
    timed = every["log_time_ns"].notna()
    grouped = every.groupby(key, dropna=False, sort=False)
    count = grouped["count"].transform("sum").where(timed, grouped["count"].transform("max"))
    every = every.assign(count=count).drop_duplicates(key)
    return pa.Table.from_pandas(every[DIAGNOSTICS.names], schema=DIAGNOSTICS, preserve_index=False)


def _without_partial_absences(rows: list[pd.DataFrame], cameras: pa.Table) -> list[pd.DataFrame]:
    """Leave out what a window says is absent, and another window has."""
    keys = [[_absence(note) for note in some.to_dict("records")] for some in rows]
    everywhere = set.intersection(*map(set, keys)) | {None}
    with_lens = set(cameras.filter(pc.is_valid(cameras["fx_px"]))["camera"].to_pylist())
    kept = []
    for some, mine in zip(rows, keys, strict=True):
        has_lens = (some["code"] == "no_lens_data") & some["camera"].isin(with_lens)
        stays = np.array([key in everywhere for key in mine], dtype=np.bool_)
        kept.append(some[stays & ~has_lens.to_numpy(dtype=np.bool_)])
    return kept


def _absence(note: Mapping[Hashable, Any]) -> tuple[str, ...] | None:
    """Return the name of what a note says is absent, None if it says nothing of the kind."""
    if note["code"] not in _ABSENCES:
        return None
    what = note["message"] if note["code"] == "unmatched_exposure" else ""
    return str(note["code"]), str(note["camera"]), str(what)
