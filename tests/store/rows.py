"""Rows for a store, written as pass 1 writes them; columns that a test does not name are filled."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.core.tables import CALIBRATIONS, ESTIMATES, PASS_ONE, TRACK_HEIGHTS
from pipeline.store.database import Store
from pipeline.store.estimates import add_calibrations, add_estimates, forget_estimates
from pipeline.store.recordings import RecordingRow, replace_recording
from pipeline.store.runs import start_run

Columns = Mapping[str, Sequence[Any]]

# What a column holds where a test says nothing; all else is null.
DEFAULTS: dict[str, Any] = {
    "camera": "cam",
    "topic": "/cam",
    "frame_index": 0,
    "track_id": 0,
    "first_frame_index": 0,
    "last_frame_index": 0,
    "first_time_ns": 0,
    "last_time_ns": 0,
    "observation_count": 1,
    "log_time_ns": 0,
    "capture_time_ns": 0,
    "decoded": True,
    "exposure_pairing": "none",
    "detector": "recorded",
    "x_min_px": 10.0,
    "y_min_px": 20.0,
    "x_max_px": 30.0,
    "y_max_px": 80.0,
    "truncated_left": False,
    "truncated_top": False,
    "truncated_right": False,
    "truncated_bottom": False,
    "method": "size",
}


def table(schema: pa.Schema, columns: Columns) -> pa.Table:
    """Return rows of a schema from the columns that matter."""
    count = max((len(v) for v in columns.values()), default=0)
    arrays = []
    for field in schema:
        default = "observation_index" if field.name == "observation_index" else None
        if field.name in columns:
            values = list(columns[field.name])
        elif default:
            values = list(range(count))
        else:
            values = [DEFAULTS.get(field.name)] * count
        arrays.append(pa.array(values, type=field.type))
    return pa.Table.from_arrays(arrays, schema=schema)


def recording(name: str = "a.mcap", content: str | None = None, **known: Any) -> RecordingRow:
    """Return what pass 1 knows of a recording; its key follows from `content`, or the name."""
    sha = hashlib.sha256((content or name).encode()).hexdigest()
    row: dict[str, Any] = {
        "path": Path("/somewhere") / name,
        "content_sha256": sha,
        "size_bytes": 1000,
        "start_time_ns": 0,
        "end_time_ns": 1,
        "frame_count": 1,
        "frames_lost": 0,
        "damaged": False,
    }
    return RecordingRow(**{**row, **known})


def write_parts(folder: Path, **tables: Columns) -> Path:
    """Write the parts of pass 1; a table that is not named is empty, tracks follow observations."""
    folder.mkdir(parents=True, exist_ok=True)
    if "tracks" not in tables and "observations" in tables:
        rows = table(PASS_ONE["observations"], tables["observations"])
        keys = sorted(
            set(zip(rows["camera"].to_pylist(), rows["track_id"].to_pylist(), strict=True))
        )
        tables["tracks"] = {"camera": [c for c, _ in keys], "track_id": [t for _, t in keys]}
    for name, schema in PASS_ONE.items():
        pq.write_table(table(schema, tables.get(name, {})), folder / f"{name}.parquet")
    return folder


def start(store: Store, label: str | None = None) -> str:
    """Start a run."""
    return start_run(store, "run", label, "{}", "{}", "0.test")


def ingest(store: Store, run_id: str, folder: Path, row: RecordingRow, **tables: Columns) -> str:
    """Write parts and take them in, in one transaction."""
    write_parts(folder, **tables)
    with store.transaction():
        return replace_recording(store, row, folder, run_id)


def write_estimates(
    store: Store,
    recording_id: str,
    run_id: str,
    estimates: pa.Table,
    track_heights: pa.Table,
    calibrations: pa.Table,
    quality: pa.Table | None = None,
) -> None:
    """Replace the estimates of a recording in a run; call inside a transaction."""
    made = {"estimates": estimates, "track_heights": track_heights}
    if quality is not None:
        made["observation_quality"] = quality
    forget_estimates(store, recording_id, run_id)
    add_estimates(store, recording_id, run_id, made)
    add_calibrations(store, calibrations, run_id)


def estimate(
    store: Store,
    recording_id: str,
    run_id: str,
    estimates: Columns,
    track_heights: Columns | None = None,
    calibrations: Columns | None = None,
) -> None:
    """Store estimates, in one transaction."""
    with store.transaction():
        write_estimates(
            store,
            recording_id,
            run_id,
            table(ESTIMATES, estimates),
            table(TRACK_HEIGHTS, track_heights or {}),
            table(CALIBRATIONS, calibrations or {}),
        )
