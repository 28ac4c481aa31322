"""Verdicts of `main.exposure_checks` on a recording, by stretches: a day needs the memory of one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from pipeline.core.robust import MAD_TO_STD
from pipeline.store.database import Store

STRETCH = 50_000  # frames: half an hour
NEIGHBOURS = 6  # on either side, by which a frame is judged: five, and one more for where a step is

_COUNTED = """
SELECT camera, verdict, count(*) AS frames, min(frame_index) AS first_frame_index,
    arg_min(capture_time_ns, frame_index) AS first_time_ns,
    max(greatest(abs(departure_ev), abs(step_ev))) AS most_ev
"""
_WHERE = "WHERE verdict <> 'agrees' AND frame_index BETWEEN $low AND $high GROUP BY ALL"


def exposure_verdicts(store: Store, recording_id: str, stretch: int = STRETCH) -> pa.Table:
    """Return the count of frames of each camera and verdict, but for those that agree."""
    cameras = store.connection.execute(
        "SELECT camera, min(frame_index), max(frame_index) FROM frames "
        "WHERE recording_id = ? GROUP BY camera ORDER BY camera",
        [recording_id],
    ).fetchall()
    found = []
    for camera, first, last in cameras:
        stretches = list(_stretches(recording_id, camera, first, last, stretch))
        scatter = _scatter(store, stretches) if len(stretches) > 1 else None
        found += [
            store.connection.sql(
                f"{_COUNTED} FROM main.exposure_checks_between($recording, $camera, $first, $last, "
                f"scatter := $scatter) {_WHERE}",
                params={**values, "scatter": scatter},
            ).to_arrow_table()
            for values in stretches
        ]
    return _summed(found)


def _stretches(
    recording_id: str, camera: str, first: int, last: int, stretch: int
) -> Iterator[dict[str, object]]:
    """Yield ranges of frames: those that are asked, and those of which the answers are wanted."""
    for low in range(first, last + 1, stretch):
        high = min(low + stretch - 1, last)
        yield {
            "recording": recording_id,
            "camera": camera,
            "first": low - NEIGHBOURS,
            "last": high + NEIGHBOURS,
            "low": low,
            "high": high,
        }


def _scatter(store: Store, stretches: list[dict[str, object]]) -> float | None:
    """Return the camera's `scatter_ev` over all of its frames."""
    departures = [
        store.connection.sql(
            "SELECT departure_ev FROM main.exposure_checks_between($recording, $camera, $first, $last) "
            "WHERE departure_ev IS NOT NULL AND frame_index BETWEEN $low AND $high",
            params=values,
        ).to_arrow_table()["departure_ev"]
        for values in stretches
    ]
    known = np.abs(np.concatenate([part.to_numpy() for part in departures]))
    return float(MAD_TO_STD * np.median(known)) if len(known) else None


def _summed(found: list[pa.Table]) -> pa.Table:
    """Return one row a camera and verdict; stretches come in the order of their frames."""
    if not found:
        return pa.table({"camera": [], "verdict": []})
    grouped = pa.concat_tables(found).group_by(["camera", "verdict"], use_threads=False)
    summed = grouped.aggregate(
        [
            ("frames", "sum"),
            ("first_frame_index", "first"),
            ("first_time_ns", "first"),
            ("most_ev", "max"),
        ]
    )
    names = ["camera", "verdict", "frames", "first_frame_index", "first_time_ns", "most_ev"]
    return summed.rename_columns(names).sort_by([("camera", "ascending"), ("verdict", "ascending")])
