"""Columns on their way into a Rerun recording: the two clocks, and rows in slices."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import rerun as rr

from dashboards.columns import Frames
from pipeline.records import IntArray

# The number of the frame within its camera, and when it was taken.
FRAME, TIME = "frame", "time"
# What the viewer itself makes chunks of; larger ones are slow to move about in.
SLICE_FRAMES = 4096

Columns = Callable[[slice], rr.ComponentColumnList]


def clocks(frame_index: IntArray, capture_time_ns: IntArray) -> list[rr.TimeColumn]:
    """Return the times of rows on both timelines."""
    return [
        rr.TimeColumn(FRAME, sequence=frame_index),
        rr.TimeColumn(TIME, timestamp=capture_time_ns.astype("datetime64[ns]")),
    ]


def clocks_of(frames: Frames, row: IntArray | slice) -> list[rr.TimeColumn]:
    """Return the times of frames by their position."""
    return clocks(frames.frame_index[row], frames.capture_time_ns[row])


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
            entity, clocks_of(frames, chosen), columns(things).partition(count[chosen])
        )


def send_rows(
    stream: rr.RecordingStream,
    entity: str,
    times: tuple[IntArray, IntArray],
    columns: Columns,
    style: rr.AsComponents | None = None,
) -> None:
    """Send one thing a row, and how it looks.

    Args:
        stream: where to.
        entity: its path.
        times: frame index and capture time of each row, (n,) each.
        columns: gives the columns by slice.
        style: what holds at all times.
    """
    if style is not None:
        stream.log(entity, style, static=True)
    frame_index, capture_time_ns = times
    for first in range(0, len(frame_index), SLICE_FRAMES):
        part = slice(first, first + SLICE_FRAMES)
        stream.send_columns(entity, clocks(frame_index[part], capture_time_ns[part]), columns(part))


def logged_markdown(stream: rr.RecordingStream, texts: Iterable[tuple[str, str]]) -> None:
    """Log text panels that hold at all times, by entity."""
    for entity, text in texts:
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        stream.log(entity, document, static=True)
