"""Depth and height over time with 95 % bands: an entity for each method, a line for each slot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import rerun as rr

from dashboards.style import METHOD_COLOURS, NEUTRAL, TRUTH, Z_95, packed, slot_colours
from dashboards.timeline.columns import BEST, BoolArray, CameraRows, Estimates, estimates_by
from dashboards.timeline.names import path, title
from dashboards.timeline.slots import LONGEST_GAP_FRAMES, slot_names, slots
from dashboards.timeline.stream import send_rows
from pipeline.core.arrays import FloatArray, IntArray

QUANTITIES = {"depth": "m", "height": "m"}
# Truth is a thin line: what is compared with it must be seen below it.
TRUTH_WIDTH, TRUTH_OPACITY = 1.0, 170
OPACITY = 190
# A height that is not known within this share of itself tells nothing of a person: adults are 1.68 m
# tall, and 95 % of them are within 11 % of that.
WIDEST_BAND = 0.2


@dataclass(frozen=True, slots=True)
class Lines:
    """Values over frames, one column for each line; NaN where a line has no value."""

    row: IntArray  # (r,), frames by position, ascending
    values: FloatArray  # (r, l)
    variances: FloatArray  # (r, l)


def log_curves(stream: rr.RecordingStream, rows: CameraRows, estimates: pa.Table) -> None:
    """Log depth and height over time by the best method and by each."""
    if rows.drawn_by == BEST:
        _log_method(stream, rows, BEST, rows.best)
    for method in rows.methods:
        by_method = estimates_by(method, estimates, rows.observations.observation_index)
        _log_method(stream, rows, method, by_method)
    _log_truth(stream, rows)


def _log_method(
    stream: rr.RecordingStream, rows: CameraRows, method: str, estimates: Estimates
) -> None:
    track = rows.observations.track
    line = rows.tracks.slot[track]
    if rows.is_series_of_pictures:
        names = [title(method)]
        colours = np.array([METHOD_COLOURS.get(method, NEUTRAL)], dtype=np.uint8)
    else:
        names = slot_names(rows.tracks.slot, [f"#{i}" for i in rows.tracks.track_id.tolist()])
        colours = slot_colours(np.arange(len(names)))
    for quantity, (value, std) in {
        "depth": (estimates.depth_m, estimates.depth_std_m),
        "height": (height_in_plots(rows, estimates), estimates.height_std_m),
    }.items():
        mine = np.isfinite(value) & (line >= 0)
        if not mine.any():
            continue
        lines = lines_over_frames(
            rows.observations.row[mine],
            line[mine],
            track[mine],
            (value[mine], (Z_95 * np.nan_to_num(std[mine])) ** 2),
            is_followed=not rows.is_series_of_pictures,
            line_count=len(names),
        )
        style = rr.Measurements.from_fields(
            names=names,
            colors=packed(colours, OPACITY),
            units=[QUANTITIES[quantity]] * len(names),
        )
        _send(stream, path("cameras", rows.name, quantity, method), rows, lines, style)


def height_in_plots(rows: CameraRows, estimates: Estimates) -> FloatArray:
    """Return the measured heights that are known well enough for a plot, NaN elsewhere.

    Of somebody half hidden the band is as tall as the plot, and hides everybody else's. Where most are
    so, all heights are in the plot.
    """
    heights, std_m = estimates.measured_height_m, estimates.height_std_m
    good = ~(Z_95 * std_m > WIDEST_BAND * heights)
    if rows.is_series_of_pictures or good.sum() < 0.5 * len(good):
        return heights
    return np.where(good, heights, np.nan)


def lines_over_frames(
    row: IntArray,
    line: IntArray,
    follows: IntArray,
    values: tuple[FloatArray, FloatArray],
    *,
    is_followed: bool,
    line_count: int,
) -> Lines:
    """Return points as lines over frames.

    A line goes straight across a short gap, as it would between two points, and is broken by a
    longer one and where another takes its place.

    Args:
        row: the frame of each point, (n,).
        line: the line of each, (n,).
        follows: what each belongs to: points of a line that differ in it are not joined, (n,).
        values: value and variance of each, (n,) each.
        is_followed: whether points are of what is followed over frames; else all are joined.
        line_count: how many lines there are.
    """
    order = np.lexsort((row, line))
    row, line, follows = row[order], line[order], follows[order]
    value, variance = values[0][order], values[1][order]
    if not is_followed:
        return Lines(row, value[:, None], variance[:, None])
    gap = np.diff(row)
    joined = (np.diff(line) == 0) & (np.diff(follows) == 0)
    joined &= (gap > 1) & (gap <= LONGEST_GAP_FRAMES)
    before = np.repeat(np.flatnonzero(joined), gap[joined] - 1)
    step = _counted(gap[joined] - 1) + 1
    share = step / gap[before] if len(before) else np.empty(0)
    all_rows = np.concatenate([row, row[before] + step])
    all_lines = np.concatenate([line, line[before]])
    used = np.unique(all_rows)
    # The frame after a line's end says that it ended.
    sent = np.union1d(used, np.setdiff1d(used + 1, used)[:-1])
    at = np.searchsorted(sent, all_rows)
    filled = []
    for known in (value, variance):
        between = known[before] + share * (known[before + 1] - known[before])
        table = np.full((len(sent), line_count), np.nan)
        table[at, all_lines] = np.concatenate([known, between])
        filled.append(table)
    return Lines(sent, filled[0], filled[1])


def _counted(counts: IntArray) -> IntArray:
    """Return 0, 1, ... for each count, one after another."""
    starts = np.cumsum(counts) - counts
    return np.arange(int(counts.sum())) - np.repeat(starts, counts)


def _send(
    stream: rr.RecordingStream,
    entity: str,
    rows: CameraRows,
    lines: Lines,
    style: rr.Measurements,
) -> None:
    count = lines.values.shape[1]
    send_rows(
        stream,
        entity,
        (rows.frames, lines.row),
        lambda part: rr.Measurements.columns(
            values=lines.values[part].ravel(), variances=lines.variances[part].ravel()
        ).partition([count] * len(lines.row[part])),
        style,
    )


def _log_truth(stream: rr.RecordingStream, rows: CameraRows) -> None:
    """Log the truth: a line for each object if objects are followed over frames, else points."""
    truth, shown = rows.truth, true_in_plots(rows)
    for quantity, values in {"depth": truth.depth_m, "height": truth.height_m}.items():
        known = np.flatnonzero(np.isfinite(values) & shown)
        if not len(known):
            continue
        entity = path("cameras", rows.name, quantity, "truth")
        if rows.is_series_of_pictures:
            _send_points(stream, entity, rows, truth.row[known], values[known])
            continue
        objects, line = _object_lines(truth.row[known], truth.object_id[known])
        mine = line[objects] >= 0
        lines = lines_over_frames(
            truth.row[known][mine],
            line[objects][mine],
            objects[mine],
            (values[known][mine], np.zeros(int(mine.sum()))),
            is_followed=True,
            line_count=int(line.max()) + 1,
        )
        count = lines.values.shape[1]
        send_rows(
            stream,
            entity,
            (rows.frames, lines.row),
            lambda part, lines=lines, count=count: rr.Scalars.columns(  # type: ignore[misc]
                scalars=lines.values[part].ravel()
            ).partition([count] * len(lines.row[part])),
            rr.SeriesLines(
                names=["truth"] * count,
                colors=[(*TRUTH, TRUTH_OPACITY)] * count,
                widths=[TRUTH_WIDTH] * count,
            ),
        )


def _object_lines(row: IntArray, object_id: np.ndarray) -> tuple[IntArray, IntArray]:
    """Return the object of each point by its number, (n,), and the line of each object, (o,)."""
    _, objects = np.unique(object_id.astype(str), return_inverse=True)
    count = int(objects.max()) + 1
    first, last = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
    np.minimum.at(first, objects, row)
    np.maximum.at(last, objects, row)
    return objects, slots(first, last)


def _send_points(
    stream: rr.RecordingStream, entity: str, rows: CameraRows, row: IntArray, values: FloatArray
) -> None:
    style = rr.SeriesPoints(
        names=["truth"], colors=[TRUTH], markers=["diamond"], marker_sizes=[3.5]
    )
    send_rows(
        stream,
        entity,
        (rows.frames, row),
        lambda part: rr.Scalars.columns(scalars=values[part]),
        style,
    )


def in_plots(rows: CameraRows) -> BoolArray:
    """Return which observations are in the plots, (n,)."""
    if rows.alone_track is not None:
        return np.asarray(rows.observations.track == rows.alone_track)
    return np.asarray(rows.tracks.slot[rows.observations.track] >= 0)


def true_in_plots(rows: CameraRows) -> BoolArray:
    """Return which rows of the truth are in the plots, (g,): all, or what one track was matched to."""
    if rows.alone_track is None:
        return np.ones(len(rows.truth.row), dtype=np.bool_)
    if rows.matched is None:
        return np.zeros(len(rows.truth.row), dtype=np.bool_)
    mine = rows.matched.object_id[rows.observations.track == rows.alone_track]
    return np.isin(rows.truth.object_id.astype(str), [str(o) for o in mine if o is not None])
