"""Timelines of recordings for Rerun: the pictures with the measurements in them.

Pictures pass through undecoded. Everything is sent as columns; nothing is logged object by object.

    cameras/NAME/camera              the lens, and where it is
    cameras/NAME/camera/image        the pictures
    cameras/NAME/camera/tracks       boxes in the picture; labels and truth beside them
    cameras/NAME/people, truth       bodies where things stand and where they truly were, in metres
    cameras/NAME/trails/AGE          their paths so far
    cameras/NAME/ground              the part of it in the picture, and distances
    cameras/NAME/depth/METHOD        depth over time, a line for each slot; `best` is what is drawn
    cameras/NAME/height/METHOD       height over time, where it was measured
    cameras/NAME/error/WHAT/METHOD   errors against the truth; `worst` marks the largest ones
    cameras/NAME/lanes/LANE          states of tracks and exposure, and diagnostics
    cameras/NAME/exposure/WHAT       EV100, ISO, shutter, f-number, luminance
    about, tracks, diagnostics       the recordings, their tracks, and diagnostics

Of several recordings NAME is that of the file and of the camera. They share the clocks `time` and
`elapsed`; the frames of each are its own.

The number of entities does not grow with the number of tracks: tracks share slots
(`dashboards.timeline.slots`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain, takewhile
from pathlib import Path
from threading import Event
from typing import Any

import pyarrow as pa
import rerun as rr

from dashboards.timeline.blueprint import APPLICATION, CameraView, blueprint, camera_view
from dashboards.timeline.columns import CameraRows, camera_rows
from dashboards.timeline.curves import log_curves
from dashboards.timeline.documents import about_text, tracks_text
from dashboards.timeline.error_curves import log_errors
from dashboards.timeline.exposure_curves import log_exposure
from dashboards.timeline.lanes import log_lanes
from dashboards.timeline.names import markdown, path, visible
from dashboards.timeline.notes_log import log_diagnostics
from dashboards.timeline.picture import log_boxes
from dashboards.timeline.scene import log_camera, log_ground, log_people
from dashboards.timeline.source import Source
from dashboards.timeline.stills import log_images, preview_scale
from dashboards.timeline.stream import logged_markdown
from pipeline.core.errors import StadimeterError, Where
from pipeline.core.files import refuse_special, whole_file


@dataclass(frozen=True, slots=True)
class TimelineOptions:
    """Options for writing a timeline."""

    preview_px: int | None = None  # the longer side of the pictures; None: as they are
    track: int | None = None  # a track that has the plots for itself


def write_timeline(
    target: Path, sources: Sequence[Source], options: TimelineOptions | None = None
) -> None:
    """Write a `.rrd`, and its blueprint as `.rbl` beside it; they appear when they are complete.

    Args:
        target: the file to write.
        sources: recordings with their rows and pictures, one or more.
        options: as usual if there are none.

    Raises:
        StadimeterError: the files cannot be written.
    """
    options = options or TimelineOptions()
    cameras = [_cameras(source, options, len(sources)) for source in sources]
    layout = blueprint(
        [camera_view(rows) for own in cameras for rows in own],
        has_diagnostics=any(source.tables["diagnostics"].num_rows for source in sources),
    )
    refuse_special(target, "the timeline")
    part = target.with_name(f"{target.name}.part")
    target.parent.mkdir(parents=True, exist_ok=True)
    stream = rr.RecordingStream(APPLICATION, recording_id=_identity(sources, options))
    try:
        stream.save(part, default_blueprint=layout)
        stream.send_recording_name(_name(sources))
        # First how the cameras see: a picture without that is no part of the scene to the viewer.
        for rows in chain.from_iterable(cameras):
            log_camera(stream, rows, frustum_m=camera_view(rows).middle_m / 5)
        stop = Event()
        with ThreadPoolExecutor(1) as aside:
            pictures = aside.submit(_log_pictures, stream, sources, cameras, options, stop)
            try:
                _log_rows(stream, sources, cameras)
                pictures.result()
            finally:
                stop.set()
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
        with suppress(OSError):
            part.unlink(missing_ok=True)


def camera_views(sources: Sequence[Source], options: TimelineOptions) -> list[CameraView]:
    """Return the layout facts of the cameras of some recordings."""
    cameras = (_cameras(source, options, len(sources)) for source in sources)
    return [camera_view(rows) for own in cameras for rows in own]


def _identity(sources: Sequence[Source], options: TimelineOptions) -> str:
    """Return a name that is different for different content: the viewer merges two of one name."""
    frames = [
        (f["frame_index"][0].as_py(), f.num_rows) if f.num_rows else None
        for f in (source.tables["frames"] for source in sources)
    ]
    keys = [str(source.recording["recording_id"]) for source in sources]
    return hashlib.sha256(repr((keys, frames, options)).encode()).hexdigest()[:16]


def _name(sources: Sequence[Source]) -> str:
    return ", ".join(visible(source.recording["file_name"]) for source in sources)


def _stem(source: Source) -> str:
    return Path(str(source.recording["file_name"])).stem


def _cameras(source: Source, options: TimelineOptions, sources: int) -> list[CameraRows]:
    """Return the rows of each camera that has frames; of several recordings each has two names."""
    frames = source.tables["frames"]
    seen = set(frames["camera"].unique().to_pylist())
    cameras = [c for c in source.tables["cameras"].to_pylist() if c["camera"] in seen]
    return [
        camera_rows(
            camera,
            source.tables,
            name=f"{_stem(source)} · {camera['camera']}" if sources > 1 else None,
            scale=preview_scale(camera["width_px"], camera["height_px"], options.preview_px),
            cameras=max(sources, len(cameras)),
            alone=options.track,
        )
        for camera in cameras
    ]


def _log_pictures(
    stream: rr.RecordingStream,
    sources: Sequence[Source],
    cameras: Sequence[Sequence[CameraRows]],
    options: TimelineOptions,
    stop: Event,
) -> None:
    """Send the pictures, in a thread of its own: most of it is waiting for bytes to be copied."""
    for source, own in zip(sources, cameras, strict=True):
        by_name = {str(rows.camera["camera"]): rows for rows in own}
        images = takewhile(lambda _: not stop.is_set(), source.images)
        log_images(stream, images, by_name, options.preview_px)


def _log_rows(
    stream: rr.RecordingStream, sources: Sequence[Source], cameras: Sequence[Sequence[CameraRows]]
) -> None:
    _log_texts(stream, sources, cameras)
    for source, own in zip(sources, cameras, strict=True):
        for rows in own:
            _log_scene(stream, rows, source.tables)
        place = path("diagnostics", *([_stem(source)] if len(sources) > 1 else []))
        log_diagnostics(stream, place, source.tables["diagnostics"], own)


def _log_texts(
    stream: rr.RecordingStream, sources: Sequence[Source], cameras: Sequence[Sequence[CameraRows]]
) -> None:
    about, tracks = [], []
    for source, own in zip(sources, cameras, strict=True):
        about.append(about_text(source.recording, own, source.tables))
        heading = [f"### {markdown(_stem(source))}"] if len(sources) > 1 else []
        tracks += [*heading, tracks_text(source.tables, own)]
    texts = [("about", "\n\n".join(about)), ("tracks", "\n\n".join(tracks))]
    logged_markdown(stream, texts)


def _save_layout(layout: Any, target: Path) -> None:
    with whole_file(target, "the layout of the timeline") as part:
        layout.save(APPLICATION, str(part))


def _log_scene(
    stream: rr.RecordingStream, rows: CameraRows, tables: Mapping[str, pa.Table]
) -> None:
    view: CameraView = camera_view(rows)
    log_ground(stream, rows, view.ruler_m, view.ahead_m[1])
    log_boxes(stream, rows)
    log_people(stream, rows)
    log_curves(stream, rows, tables["estimates"])
    log_errors(stream, rows, tables["estimates"])
    log_exposure(stream, rows.name, rows.frames)
    log_lanes(stream, rows, tables["diagnostics"])
