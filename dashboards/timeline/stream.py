"""Columns on their way into a Rerun recording: the clocks, and rows in slices."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import rerun as rr

from dashboards.timeline.columns import Frames
from pipeline.core.arrays import IntArray

# The number of the frame within its camera, when it was taken, and how long after the recording's
# start that was: the clock that recordings of different days share.
FRAME, TIME, ELAPSED = "frame", "time", "elapsed"
# What the viewer itself makes chunks of; larger ones are slow to move about in.
SLICE_FRAMES = 4096

Columns = Callable[[slice], rr.ComponentColumnList]


def clocks(frames: Frames, row: IntArray | slice) -> list[rr.TimeColumn]:
    """Return the times of frames, by their position, on all timelines."""
    capture_time_ns = frames.capture_time_ns[row]
    return [
        rr.TimeColumn(FRAME, sequence=frames.frame_index[row]),
        rr.TimeColumn(TIME, timestamp=capture_time_ns.astype("datetime64[ns]")),
        rr.TimeColumn(
            ELAPSED, duration=(capture_time_ns - frames.start_ns).astype("timedelta64[ns]")
        ),
    ]


def send_sets(
    stream: rr.RecordingStream,
    entity: str,
    frames: Frames,
    row: IntArray,
    columns: Columns,
    style: rr.AsComponents | None = None,
) -> None:
    """Send a set of things a frame; one in which there are none clears those of the frame before.

    Args:
        stream: where to.
        entity: its path.
        frames: the frames of the camera.
        row: the frame of each thing, as a position in `frames`; ascending, (n,).
        columns: gives the columns of things by their slice.
        style: what holds at all times.
    """
    if not len(row):
        return
    if style is not None:
        stream.log(entity, style, static=True)
    starts = np.searchsorted(row, np.arange(len(frames) + 1))
    count = np.diff(starts)
    sent = np.flatnonzero((count > 0) | (np.concatenate([[0], count[:-1]]) > 0))
    for first in range(0, len(sent), SLICE_FRAMES):
        chosen = sent[first : first + SLICE_FRAMES]
        things = slice(int(starts[chosen[0]]), int(starts[chosen[-1] + 1]))
        stream.send_columns(
            entity, clocks(frames, chosen), columns(things).partition(count[chosen])
        )


def send_rows(
    stream: rr.RecordingStream,
    entity: str,
    at: tuple[Frames, IntArray],
    columns: Columns,
    style: rr.AsComponents | None = None,
) -> None:
    """Send one thing for each row, and how it looks.

    Args:
        stream: where to.
        entity: its path.
        at: the frames of the camera, and the frame of each row as a position in them, (n,).
        columns: gives the columns by slice.
        style: what holds at all times.
    """
    if style is not None:
        stream.log(entity, style, static=True)
    frames, row = at
    for first in range(0, len(row), SLICE_FRAMES):
        part = slice(first, first + SLICE_FRAMES)
        stream.send_columns(entity, clocks(frames, row[part]), columns(part))


def logged_markdown(stream: rr.RecordingStream, texts: Iterable[tuple[str, str]]) -> None:
    """Log text panels that hold at all times, by entity."""
    for entity, text in texts:
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        stream.log(entity, document, static=True)
