"""Depth, height and exposure over time, an entity a curve."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import rerun as rr

from dashboards.columns import BEST, CameraRows, Estimates, Frames, Truth, estimates_by, floats
from dashboards.names import path
from dashboards.scene import LONGEST_GAP_FRAMES
from dashboards.stream import send_rows
from dashboards.style import METHOD_COLOURS, NEUTRAL, TRUTH, Z_95
from pipeline.records import FloatArray, IntArray

# More curves than this hide each other; the others are there, switched off.
CURVES_SHOWN = 12
# The file's index grows with the square of the entities; the curves of more are in the database.
CURVES_KEPT = 24
QUANTITIES = {"depth": "m", "height": "m"}
EXPOSURE = {"f_number": "f-number", "ev100": "EV100", "luminance": "relative luminance"}


@dataclass(frozen=True, slots=True)
class _Curve:
    """The observations of a curve: one track, or all of a series of pictures."""

    part: str  # of the entity's path
    title: str
    rows: IntArray  # observations in the order of time
    colour: tuple[int, int, int] | None  # None: the method's
    shown: bool


def log_curves(stream: rr.RecordingStream, rows: CameraRows, estimates: pa.Table) -> None:
    """Log depth and height over time by the best method and by each, with 95 % bands."""
    curves = list(_curves(rows))
    if rows.drawn_by == BEST:
        _log_method(stream, rows, curves, BEST, rows.best)
    for method in rows.methods:
        by_method = estimates_by(method, estimates, rows.observations.observation_index)
        _log_method(stream, rows, curves, method, by_method)
    _log_truth(stream, rows)


def _curves(rows: CameraRows) -> Iterator[_Curve]:
    """Yield the curves of the longest tracks, the longest first."""
    track = rows.observations.track
    if rows.is_series_of_pictures:
        yield _Curve("all", "", np.arange(len(track)), None, True)
        return
    order = np.lexsort((rows.observations.row, track))
    starts = np.searchsorted(track[order], np.arange(len(rows.tracks.track_id) + 1))
    for rank, i in enumerate(longest_tracks(rows)[:CURVES_KEPT].tolist()):
        number = int(rows.tracks.track_id[i])
        colour = tuple(rows.tracks.colour[i].tolist())
        mine = order[starts[i] : starts[i + 1]]
        yield _Curve(f"track_{number}", f"#{number}", mine, colour, rank < CURVES_SHOWN)


def longest_tracks(rows: CameraRows) -> IntArray:
    """Return tracks by position, those with the most observations first."""
    return np.argsort(-rows.tracks.observation_count, kind="stable")


def _log_method(
    stream: rr.RecordingStream,
    rows: CameraRows,
    curves: list[_Curve],
    method: str,
    values: Estimates,
) -> None:
    of_method = METHOD_COLOURS.get(method, np.array(NEUTRAL)).tolist()
    quantities = {
        "depth": (values.depth_m, values.depth_std_m),
        "height": (values.measured_height_m, values.height_std_m),
    }
    for quantity, (value, std) in quantities.items():
        for curve in curves:
            mine = curve.rows[np.isfinite(value[curve.rows])]
            if not len(mine):
                continue
            style = rr.Measurements.from_fields(
                names=[curve.title or method],
                colors=[curve.colour or of_method],
                units=[QUANTITIES[quantity]],
                visible_series=[curve.shown],
            )
            entity = path("cameras", rows.name, quantity, method, curve.part)
            _send_curve(stream, entity, rows, mine, (value[mine], std[mine]), style)


def _send_curve(
    stream: rr.RecordingStream,
    entity: str,
    rows: CameraRows,
    mine: IntArray,
    values: tuple[FloatArray, FloatArray],
    style: rr.Measurements,
) -> None:
    """Send one curve; it is broken where nothing was seen for long."""
    row = rows.observations.row[mine]
    away = np.flatnonzero(np.diff(row) > LONGEST_GAP_FRAMES) + 1
    if rows.is_series_of_pictures:
        away = away[:0]
    at_row = np.insert(row, away, row[away - 1] + 1)
    value = np.insert(values[0], away, np.nan)
    variance = np.insert((Z_95 * np.nan_to_num(values[1])) ** 2, away, np.nan)
    times = (rows.frames.frame_index[at_row], rows.frames.capture_time_ns[at_row])
    send_rows(
        stream,
        entity,
        times,
        lambda part: rr.Measurements.columns(values=value[part], variances=variance[part]),
        style,
    )


def _log_truth(stream: rr.RecordingStream, rows: CameraRows) -> None:
    """Log the truth as points, an entity an object."""
    truth = rows.truth
    for quantity, values in {"depth": truth.depth_m, "height": truth.height_m}.items():
        known = np.flatnonzero(np.isfinite(values))
        for part, mine in _objects(rows, truth, known):
            style = rr.SeriesPoints(
                names=["truth"], colors=[TRUTH], markers=["diamond"], marker_sizes=[3.5]
            )
            entity = path("cameras", rows.name, quantity, "truth", part)
            row, value = truth.row[mine], values[mine]
            times = (rows.frames.frame_index[row], rows.frames.capture_time_ns[row])
            send_rows(
                stream,
                entity,
                times,
                lambda part, value=value: rr.Scalars.columns(  # type: ignore[misc]
                    scalars=value[part]
                ),
                style,
            )


def _objects(rows: CameraRows, truth: Truth, known: IntArray) -> Iterator[tuple[str, IntArray]]:
    """Yield the objects with the most truth, and where it is; in a series of pictures all at once."""
    if not len(known):
        return
    if rows.is_series_of_pictures:
        yield "all", known
        return
    names, which, count = np.unique(
        truth.object_id[known].astype(str), return_inverse=True, return_counts=True
    )
    for i in np.argsort(-count, kind="stable")[:CURVES_KEPT].tolist():
        yield f"object_{names[i]}", known[which == i]


def log_exposure(stream: rr.RecordingStream, rows: CameraRows) -> None:
    """Log f-number, EV100 and luminance where they are known."""
    for name, (values, known) in exposure_curves(rows.frames).items():
        send_rows(
            stream,
            path("cameras", rows.name, "exposure", name),
            (rows.frames.frame_index[known], rows.frames.capture_time_ns[known]),
            lambda part, values=values[known]: rr.Scalars.columns(  # type: ignore[misc]
                scalars=values[part]
            ),
            rr.SeriesLines(names=[EXPOSURE[name]], colors=[NEUTRAL], widths=[1.5]),
        )


def exposure_curves(frames: Frames) -> dict[str, tuple[FloatArray, IntArray]]:
    """Return the exposure values that are known of any frame, and where."""
    curves = {}
    for name in EXPOSURE:
        values = floats(frames.table, name)
        known = np.flatnonzero(np.isfinite(values))
        if len(known):
            curves[name] = (values, known)
    return curves
