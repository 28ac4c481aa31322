"""Source of a timeline: the rows of a recording in the database, and the pictures of its file.

Of a long recording a span of time is read: its rows by SQL, its pictures by the index of the file.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from mcap.exceptions import McapError

from dashboards.timeline.stills import StillEncoded
from pipeline.core.config import Config
from pipeline.core.diagnostics import Notes
from pipeline.images.raw import compressed
from pipeline.ingest.frames import FrameAssembler
from pipeline.mcap_file.indexed import IndexedMessage, indexed_messages, summary_of
from pipeline.mcap_file.reader import McapFile
from pipeline.messages.protobuf import bytes_field
from pipeline.messages.tree import UndecodableMessage
from pipeline.store.database import Store
from pipeline.store.estimates import read_current

PASS_ONE_TABLES = (
    "cameras",
    "frames",
    "observations",
    "tracks",
    "ground_truth",
    "matches",
    "diagnostics",
)
PASS_TWO_TABLES = ("estimates", "track_heights", "observation_quality")
COMPRESSED = "foxglove.CompressedImage"
_DATA = CompressedImage.DATA_FIELD_NUMBER


class Span(NamedTuple):
    """A stretch of log time, both ends included."""

    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class Source:
    """One recording, or a span of it."""

    recording: Mapping[str, Any]  # its row of the table `recordings`
    tables: Mapping[str, pa.Table]
    images: Iterable[StillEncoded]


def read_source(
    store: Store, recording_id: str, file: Path, config: Config, span: Span | None = None
) -> Source:
    """Return a recording with its newest estimates; its pictures are read when they are asked for."""
    recording = store.query("FROM recordings WHERE recording_id = ?", [recording_id]).to_pylist()[0]
    tables = read_tables(store, recording_id, span)
    return Source(recording, tables, pictures(file, recording, tables, config, span))


def read_tables(store: Store, recording_id: str, span: Span | None) -> dict[str, pa.Table]:
    """Return the rows of a recording, or those that belong to frames of a span."""
    if span is None:
        tables = {name: store.read(name, recording_id) for name in PASS_ONE_TABLES}
        tables |= {name: read_current(store, name, recording_id) for name in PASS_TWO_TABLES}
    else:
        tables = {
            name: store.query(f"{_SPAN} {sql}", [recording_id, *span])
            for name, sql in _OF_SPAN.items()
        }
    return tables | {"calibrations": store.query(_CALIBRATIONS, [recording_id])}


# Those that the newest estimates used, not all that the run was given.
_CALIBRATIONS = """
WITH used AS (
    SELECT DISTINCT e.run_id, e.calibration_id
    FROM estimates e SEMI JOIN main.current_run USING (recording_id, run_id)
    WHERE recording_id = ? AND calibration_id IS NOT NULL
)
SELECT c.* FROM calibrations c SEMI JOIN used USING (run_id, calibration_id)
ORDER BY camera, object_class, dimension, method, parameter, f_number
"""


_SPAN = """
WITH asked AS (SELECT ? AS recording_id, ?::BIGINT AS start_ns, ?::BIGINT AS end_ns),
frames_of AS (
    SELECT f.* FROM frames f JOIN asked a USING (recording_id)
    WHERE f.log_time_ns BETWEEN a.start_ns AND a.end_ns
),
reach AS (
    SELECT camera, min(frame_index) AS first, max(frame_index) AS last FROM frames_of GROUP BY camera
),
seen AS (
    SELECT o.* FROM observations o JOIN asked USING (recording_id) JOIN reach r USING (camera)
    WHERE o.frame_index BETWEEN r.first AND r.last
),
indexes AS (SELECT min(observation_index) AS low, max(observation_index) AS high FROM seen)
"""
_BY_INDEX = """
SELECT t.* FROM {0} t JOIN asked USING (recording_id)
SEMI JOIN main.current_run c ON t.recording_id = c.recording_id AND t.run_id = c.run_id
WHERE t.observation_index BETWEEN (SELECT low FROM indexes) AND (SELECT high FROM indexes)
"""
_BY_FRAME = """
SELECT t.* FROM {0} t JOIN asked USING (recording_id) JOIN reach r USING (camera)
WHERE t.frame_index BETWEEN r.first AND r.last
"""
_OF_SPAN = {
    "cameras": "SELECT c.* FROM cameras c JOIN asked USING (recording_id) ORDER BY camera",
    "frames": "FROM frames_of ORDER BY camera, frame_index",
    "observations": "FROM seen ORDER BY camera, frame_index, observation_index",
    "tracks": """
        SELECT t.* FROM tracks t JOIN asked USING (recording_id)
        SEMI JOIN seen s ON t.camera = s.camera AND t.track_id = s.track_id
        ORDER BY camera, track_id
    """,
    "ground_truth": _BY_FRAME.format("ground_truth"),
    "matches": _BY_FRAME.format("matches"),
    "diagnostics": """
        SELECT d.* FROM diagnostics d JOIN asked a USING (recording_id)
        WHERE d.log_time_ns IS NULL OR (d.log_time_ns <= a.end_ns
            AND coalesce(d.end_time_ns, d.log_time_ns) >= a.start_ns)
    """,
    "estimates": _BY_INDEX.format("estimates"),
    "observation_quality": _BY_INDEX.format("observation_quality"),
    "track_heights": """
        SELECT t.* FROM track_heights t JOIN asked USING (recording_id)
        SEMI JOIN main.current_run c ON t.recording_id = c.recording_id AND t.run_id = c.run_id
        SEMI JOIN seen s ON t.camera = s.camera AND t.track_id = s.track_id
    """,
}


def pictures(
    file: Path,
    recording: Mapping[str, Any],
    tables: Mapping[str, pa.Table],
    config: Config,
    span: Span | None,
) -> Iterator[StillEncoded]:
    """Yield the pictures of the frames in the tables; each is good until the next is asked for.

    A file that the first pass found whole is read by its index, and not checked again.
    """
    frames = frames_by_time(tables["frames"])
    cameras = {row["topic"]: row["camera"] for row in tables["cameras"].to_pylist()}
    if not recording["damaged"] and file.is_file():  # a bag of several files has an index for each
        with file.open("rb") as stream:
            try:
                summary = summary_of(stream)
            except (McapError, ValueError, OSError):
                summary = None
            if summary is not None and _is_plain(summary, set(cameras)):
                limit = config.limits.chunk_bytes
                messages = indexed_messages(stream, summary, set(cameras), span, limit)
                yield from _indexed(messages, cameras, frames)
                return
    yield from _assembled(file, config, cameras, frames, span)


def _is_plain(summary: Any, topics: set[str]) -> bool:
    """Return whether the pictures are compressed ones, each a message of its own, found by chunk."""
    channels = [c for c in summary.channels.values() if c.topic in topics]
    kinds = {
        (c.message_encoding, summary.schemas[c.schema_id].name)
        for c in channels
        if c.schema_id in summary.schemas
    }
    return bool(summary.chunk_indexes) and kinds == {("protobuf", COMPRESSED)}


def _indexed(
    messages: Iterable[IndexedMessage],
    cameras: Mapping[str, str],
    frames: Mapping[tuple[str, int], list[int]],
) -> Iterator[StillEncoded]:
    seen: dict[tuple[str, int], int] = defaultdict(int)
    for message in messages:
        key = (cameras[message.topic], message.log_time_ns)
        indexes, at = frames.get(key), seen[key]
        if indexes is None or at >= len(indexes):
            continue
        try:
            image = bytes_field(message.data, _DATA)
        except UndecodableMessage:
            continue  # it was no frame
        seen[key] += 1
        yield StillEncoded(key[0], indexes[at], image)


def _assembled(
    file: Path,
    config: Config,
    cameras: Mapping[str, str],
    frames: Mapping[tuple[str, int], list[int]],
    span: Span | None,
) -> Iterator[StillEncoded]:
    notes = Notes()  # the first pass has reported what is wrong with the file
    recording = McapFile(file, config.limits, notes.add)
    for frame in FrameAssembler(recording, config.ingest, notes, config.camera):
        camera = cameras.get(frame.topic, frame.camera)
        if frame.frame_index in frames.get((camera, frame.log_time_ns), ()):
            yield StillEncoded(camera, frame.frame_index, compressed(frame).image)
        elif span is not None and frame.log_time_ns > span.end_ns + _DISORDER_NS:
            return


_DISORDER_NS = 10_000_000_000  # how far out of order frames may come


def frames_by_time(frames: pa.Table) -> dict[tuple[str, int], list[int]]:
    """Return the frames by camera and log time; more than one where a time comes again."""
    found: dict[tuple[str, int], list[int]] = {}
    columns = (frames[name].to_pylist() for name in ("camera", "log_time_ns", "frame_index"))
    for camera, log_time_ns, frame_index in zip(*columns, strict=True):
        found.setdefault((camera, log_time_ns), []).append(frame_index)
    return found
