"""The timeline of one recording: its pictures with what was measured in them, for Rerun.

Pictures pass through undecoded. Everything is sent as columns; nothing is logged object by object.

    cameras/NAME/camera              the lens, and where it is
    cameras/NAME/camera/image        the pictures
    cameras/NAME/camera/tracks       boxes in the picture; labels and truth beside them
    cameras/NAME/people, truth       bodies where things stand and where they truly were, in metres
    cameras/NAME/trails/AGE          where they came from
    cameras/NAME/ground              what of it the picture shows, and distances
    cameras/NAME/depth/METHOD        depth over time, a line a slot; METHOD `best` is what is drawn
    cameras/NAME/height/METHOD       height over time, where it was measured
    cameras/NAME/error/WHAT/METHOD   errors against the truth; `worst` marks the largest
    cameras/NAME/lanes/LANE          states of tracks, of exposure, of what was wrong
    cameras/NAME/exposure/WHAT       EV100, ISO, shutter, f-number, luminance
    about, tracks, diagnostics       what recording this is, its tracks, and what was wrong with it

However many tracks there are, the entities are as many: tracks share slots (`dashboards.slots`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import rerun as rr

from dashboards.blueprint import APPLICATION, blueprint, camera_view
from dashboards.columns import CameraRows, camera_rows
from dashboards.curves import log_curves
from dashboards.documents import about_text, tracks_text
from dashboards.errors import log_errors
from dashboards.exposure import log_exposure
from dashboards.lanes import log_lanes
from dashboards.names import path, visible
from dashboards.picture import log_boxes
from dashboards.scene import log_camera, log_ground, log_people
from dashboards.stream import clocks, logged_markdown
from pipeline.errors import StadimeterError, Where
from pipeline.records import IntArray

# Pictures are sent in batches: large enough for columns to pay, small enough for a flat memory.
BATCH_BYTES = 8 * 1024**2
# What a picture is, by its first bytes; what the recording calls it may be anything.
SIGNATURES = ((b"\xff\xd8\xff", "image/jpeg"), (b"\x89PNG", "image/png"), (b"RIFF", "image/webp"))
LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class StillEncoded(NamedTuple):
    """One picture on its way through."""

    camera: str
    frame_index: int
    capture_time_ns: int
    image_format: str
    image: bytes


def write_timeline(
    target: Path,
    recording: Mapping[str, Any],
    images: Iterable[StillEncoded | tuple[str, int, int, str, bytes]],
    tables: Mapping[str, pa.Table],
) -> None:
    """Write a `.rrd`, and its blueprint as `.rbl` beside it; they appear when they are complete.

    Args:
        target: the file to write.
        recording: the row of the table `recordings`; `software_version` may stand in it.
        images: the pictures, in any order.
        tables: rows of that recording: cameras, frames, tracks, observations, estimates, track_heights,
            ground_truth, diagnostics; matches and calibrations where there are any.

    Raises:
        StadimeterError: the files cannot be written.
    """
    cameras = [camera_rows(row, tables) for row in tables["cameras"].to_pylist()]
    layout = blueprint([camera_view(rows) for rows in cameras])
    part = target.with_name(f"{target.name}.part")
    target.parent.mkdir(parents=True, exist_ok=True)
    stream = rr.RecordingStream(APPLICATION, recording_id=str(recording["recording_id"]))
    try:
        stream.save(part, default_blueprint=layout)
        stream.send_recording_name(visible(recording["file_name"]))
        about = about_text(recording, cameras, tables)
        tracks = tracks_text(tables["track_heights"], tables["tracks"], cameras)
        logged_markdown(stream, [("about", about), ("tracks", tracks)])
        for rows in cameras:
            _log_camera(stream, rows, tables)
        _log_diagnostics(stream, tables["diagnostics"], tables["frames"])
        _log_images(stream, images, _undecodable(tables["frames"]))
        stream.flush()
        stream.disconnect()
        part.replace(target)
        _save_layout(layout, target.with_suffix(".rbl"))
    except (OSError, RuntimeError) as error:
        raise StadimeterError(
            f"the timeline cannot be written: {error}",
            where=Where(target),
            remedy="Check that there is room on the disk and that the folder can be written",
        ) from error
    finally:
        stream.disconnect()
        part.unlink(missing_ok=True)


def _save_layout(layout: Any, target: Path) -> None:
    part = target.with_name(f"{target.name}.part")
    layout.save(APPLICATION, str(part))
    part.replace(target)


def _log_camera(
    stream: rr.RecordingStream, rows: CameraRows, tables: Mapping[str, pa.Table]
) -> None:
    view = camera_view(rows)
    log_camera(stream, rows, frustum_m=view.middle_m / 5)
    log_ground(stream, rows, view.ruler_m, view.ahead_m[1])
    log_boxes(stream, rows)
    log_people(stream, rows)
    log_curves(stream, rows, tables["estimates"])
    log_errors(stream, rows, tables["estimates"])
    log_exposure(stream, rows.name, rows.frames)
    log_lanes(stream, rows, tables["diagnostics"])


def _log_images(
    stream: rr.RecordingStream,
    images: Iterable[StillEncoded | tuple[str, int, int, str, bytes]],
    undecodable: frozenset[tuple[str, int]],
) -> None:
    """Send the pictures as they are, in batches.

    A picture that cannot be decoded is left out, so that its frame shows none, not the one before.
    """
    for camera, batch in _batches(images):
        kept = [p for p in batch if p[4] and (camera, p[1]) not in undecodable]
        shown = np.array([bool(p[4]) and (camera, p[1]) not in undecodable for p in batch])
        columns = rr.EncodedImage.columns(
            blob=[p[4] for p in kept], media_type=[_media_type(p[4]) for p in kept]
        )
        index = clocks(
            np.array([p[1] for p in batch], dtype=np.int64),
            np.array([p[2] for p in batch], dtype=np.int64),
        )
        entity = path("cameras", camera, "camera", "image")
        stream.send_columns(entity, index, columns.partition(shown.astype(np.int64)))


def _media_type(image: bytes) -> str:
    return next((kind for start, kind in SIGNATURES if image.startswith(start)), "image/jpeg")


def _batches(
    images: Iterable[StillEncoded | tuple[str, int, int, str, bytes]],
) -> Iterator[tuple[str, list[StillEncoded | tuple[str, int, int, str, bytes]]]]:
    """Yield pictures of one camera at a time; all that wait are within the size of a batch."""
    waiting: dict[str, list[StillEncoded | tuple[str, int, int, str, bytes]]] = {}
    size = 0
    for image in images:
        waiting.setdefault(image[0], []).append(image)
        size += len(image[4])
        if size >= BATCH_BYTES:
            yield from waiting.items()
            waiting, size = {}, 0
    yield from waiting.items()


def _undecodable(frames: pa.Table) -> frozenset[tuple[str, int]]:
    lost = frames.filter(pc.invert(frames["decoded"]))
    return frozenset(zip(lost["camera"].to_pylist(), lost["frame_index"].to_pylist(), strict=True))


def _log_diagnostics(stream: rr.RecordingStream, diagnostics: pa.Table, frames: pa.Table) -> None:
    """Log what was wrong at the frame that it belongs to; what has no time, at the first."""
    if not diagnostics.num_rows or not frames.num_rows:
        return
    frames = frames.sort_by("log_time_ns")
    log_time_ns = frames["log_time_ns"].to_numpy()
    rows = diagnostics.to_pylist()
    at_ns = np.array(
        [log_time_ns[0] if r["log_time_ns"] is None else r["log_time_ns"] for r in rows]
    )
    order = np.argsort(at_ns, kind="stable")
    at_frame: IntArray = np.searchsorted(log_time_ns, at_ns[order], side="right") - 1
    at_frame = np.maximum(at_frame, 0)
    columns = rr.TextLog.columns(
        text=[_diagnostic_text(rows[i]) for i in order],
        level=[LEVELS.get(rows[i]["severity"], "INFO") for i in order],
    )
    index = clocks(
        frames["frame_index"].to_numpy()[at_frame].astype(np.int64),
        frames["capture_time_ns"].to_numpy()[at_frame],
    )
    stream.send_columns("diagnostics", index, columns)


def _diagnostic_text(row: Mapping[str, Any]) -> str:
    times = f" ({row['count']:,} times)" if row["count"] > 1 else ""
    place = f"{visible(row['camera'])}: " if row["camera"] else ""
    return f"{place}{row['code']}: {visible(row['message'])}{times}"
