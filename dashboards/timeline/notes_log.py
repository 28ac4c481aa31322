"""Diagnostics as log entries, at the frame that each belongs to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from dashboards.timeline.columns import CameraRows
from dashboards.timeline.names import visible
from dashboards.timeline.stream import clocks
from pipeline.core.arrays import IntArray

LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


def log_diagnostics(
    stream: rr.RecordingStream, entity: str, diagnostics: pa.Table, cameras: Sequence[CameraRows]
) -> None:
    """Log what was wrong at its time by the clock of its camera; what has no time, at the start."""
    frames_of = {str(rows.camera["camera"]): rows.frames for rows in cameras if len(rows.frames)}
    if not diagnostics.num_rows or not frames_of:
        return
    longest = max(frames_of.values(), key=len)
    notes: dict[int, list[Mapping[str, Any]]] = {}
    for note in diagnostics.to_pylist():
        notes.setdefault(id(frames_of.get(note["camera"], longest)), []).append(note)
    for frames in frames_of.values():
        mine = notes.get(id(frames), [])
        if not mine:
            continue
        log_time_ns = np.maximum.accumulate(frames.log_time_ns)
        at_ns = np.array(
            [log_time_ns[0] if n["log_time_ns"] is None else n["log_time_ns"] for n in mine]
        )
        order = np.argsort(at_ns, kind="stable")
        row: IntArray = np.searchsorted(log_time_ns, at_ns[order], side="right") - 1
        columns = rr.TextLog.columns(
            text=[_text(mine[i]) for i in order],
            level=[LEVELS.get(mine[i]["severity"], "INFO") for i in order],
        )
        stream.send_columns(entity, clocks(frames, np.maximum(row, 0)), columns)


def _text(note: Mapping[str, Any]) -> str:
    times = f" ({note['count']:,} times)" if note["count"] > 1 else ""
    place = f"{visible(note['camera'])}: " if note["camera"] else ""
    return f"{place}{visible(note['code'])}: {visible(note['message'])}{times}"
