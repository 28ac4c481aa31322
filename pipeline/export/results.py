"""Results of the current run for each frame of a recording, in slices, so that a day stays small."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.estimate.methods import NAMES
from pipeline.store.database import Store

SLICE_FRAMES = 4096
Row = Mapping[str, Any]

_FRAMES = """
SELECT camera, frame_index, log_time_ns, capture_time_ns
FROM frames WHERE recording_id = ? ORDER BY log_time_ns, camera, frame_index
LIMIT ? OFFSET ?
"""
_OBSERVATIONS = """
WITH seen AS (
    FROM observations
    SEMI JOIN (
        FROM frames WHERE recording_id = $recording AND log_time_ns BETWEEN $first AND $last
    ) USING (recording_id, camera, frame_index)
), best AS (
    FROM estimates
    SEMI JOIN main.current_run USING (recording_id, run_id)
    SEMI JOIN seen USING (recording_id, observation_index)
    QUALIFY row_number() OVER (
        PARTITION BY observation_index ORDER BY list_position($methods, method)
    ) = 1
), quality AS (
    FROM observation_quality
    SEMI JOIN main.current_run USING (recording_id, run_id)
    SEMI JOIN seen USING (recording_id, observation_index)
)
SELECT seen.*, best.* EXCLUDE (recording_id, observation_index), quality.quality
FROM seen
LEFT JOIN best USING (observation_index)
LEFT JOIN quality USING (observation_index)
ORDER BY observation_index
"""


@dataclass(frozen=True, slots=True)
class FrameResult:
    """One frame and the observations in it, each with the estimate of the first method that has one."""

    camera: str
    frame_index: int
    log_time_ns: int
    capture_time_ns: int
    objects: tuple[Row, ...]


def frame_results(store: Store, recording_id: str) -> Iterator[FrameResult]:
    """Yield every frame of a recording in the order of log time."""
    offset = 0
    while True:
        frames = store.query(_FRAMES, [recording_id, SLICE_FRAMES, offset]).to_pylist()
        if not frames:
            return
        offset += len(frames)
        yield from _with_objects(store, recording_id, frames)


def _with_objects(store: Store, recording_id: str, frames: list[Row]) -> Iterator[FrameResult]:
    parameters = {
        "recording": recording_id,
        "first": frames[0]["log_time_ns"],
        "last": frames[-1]["log_time_ns"],
        "methods": list(NAMES),
    }
    objects: dict[tuple[str, int], list[Row]] = {}
    for row in store.query(_OBSERVATIONS, parameters).to_pylist():
        objects.setdefault((row["camera"], row["frame_index"]), []).append(row)
    for frame in frames:
        key = (frame["camera"], frame["frame_index"])
        yield FrameResult(
            *key, frame["log_time_ns"], frame["capture_time_ns"], tuple(objects.get(key, ()))
        )
