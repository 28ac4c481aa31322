"""Errors against the truth: curves over frames, one line for each method, with the largest marked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import rerun as rr

from dashboards.style import ERROR, METHOD_COLOURS, NEUTRAL
from dashboards.timeline.columns import CameraRows, Estimates, estimates_by
from dashboards.timeline.lanes import log_marks
from dashboards.timeline.names import path, title
from dashboards.timeline.stream import clocks, send_rows
from pipeline.core.arrays import FloatArray, IntArray

WORST = 10
# Two of the worst are two findings if they are of two objects, or so many frames apart.
APART_FRAMES = 15
# How many candidates are looked at for them: enough to leave out those beside each other.
CANDIDATES = 5_000
QUANTITIES = {"depth": "% of the depth", "height": "cm"}


@dataclass(frozen=True, slots=True)
class Worst:
    """The observations that are the most wrong, (w,) each, in the order of time."""

    observation: IntArray  # by position
    error: FloatArray  # relative, signed


def errors_of(rows: CameraRows, estimates: Estimates) -> dict[str, FloatArray]:
    """Return the error of each observation by quantity, (n,): depth in percent, height in cm."""
    matched = rows.matched
    if matched is None:
        return {}
    return {
        "depth": 100 * (estimates.depth_m - matched.depth_m) / matched.depth_m,
        "height": 100 * (estimates.measured_height_m - matched.height_m),
    }


def log_errors(stream: rr.RecordingStream, rows: CameraRows, estimates: pa.Table) -> None:
    """Log the median error of each frame by method, and the worst errors of what is drawn."""
    if rows.matched is None:
        return
    by_method = {
        method: errors_of(
            rows, estimates_by(method, estimates, rows.observations.observation_index)
        )
        for method in rows.methods
    }
    for quantity, unit in QUANTITIES.items():
        _log_medians(stream, rows, quantity, unit, {m: e[quantity] for m, e in by_method.items()})
    _log_worst(stream, rows)


def _log_medians(
    stream: rr.RecordingStream,
    rows: CameraRows,
    quantity: str,
    unit: str,
    errors: Mapping[str, FloatArray],
) -> None:
    for method, error in errors.items():
        known = np.isfinite(error)
        if not known.any():
            continue
        row, median = frame_medians(rows.observations.row[known], np.abs(error[known]))
        colour = METHOD_COLOURS.get(method, np.array(NEUTRAL))
        send_rows(
            stream,
            path("cameras", rows.name, "error", quantity, method),
            (rows.frames, row),
            lambda part, median=median: rr.Scalars.columns(  # type: ignore[misc]
                scalars=median[part]
            ),
            rr.SeriesLines(names=[f"{title(method)}, {unit}"], colors=[colour], widths=[1.5]),
        )


def frame_medians(row: IntArray, values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return the frames that have values, ascending, and the median of each.

    Args:
        row: the frame of each value, (n,).
        values: (n,).
    """
    order = np.lexsort((values, row))
    row, values = row[order], values[order]
    rows, start, count = np.unique(row, return_index=True, return_counts=True)
    low, high = start + (count - 1) // 2, start + count // 2
    return rows, (values[low] + values[high]) / 2


def worst_errors(rows: CameraRows) -> Worst | None:
    """Return the worst depth errors of what is drawn, one of each object at a time."""
    errors = errors_of(rows, rows.best)
    if not errors:
        return None
    size = np.nan_to_num(np.abs(errors["depth"]), nan=-1.0)
    candidates = np.argsort(-size, kind="stable")[:CANDIDATES]
    chosen: list[int] = []
    row, track = rows.observations.row, rows.observations.track
    for at in candidates[size[candidates] > 0].tolist():
        if all(track[at] != track[c] or abs(row[at] - row[c]) > APART_FRAMES for c in chosen):
            chosen.append(at)
        if len(chosen) == WORST:
            break
    if not chosen:
        return None
    observation = np.array(chosen, dtype=np.int64)
    observation = observation[np.lexsort((-size[observation], row[observation]))]
    return Worst(observation, errors["depth"][observation])


def _log_worst(stream: rr.RecordingStream, rows: CameraRows) -> None:
    worst = worst_errors(rows)
    if worst is None or rows.matched is None:
        return
    seen, best = rows.observations, rows.best
    row = seen.row[worst.observation]
    depth_m, true_m = best.depth_m[worst.observation], rows.matched.depth_m[worst.observation]
    number = rows.tracks.track_id[seen.track[worst.observation]]
    method = rows.best_method[worst.observation]
    texts = [
        f"#{n}: {d:.2f} m by {title(m)}, truly {t:.2f} m: {e:+.1f} %"
        for n, d, m, t, e in zip(number, depth_m, method, true_m, worst.error, strict=True)
    ]
    index = clocks(rows.frames, row)
    stream.send_columns(
        path("cameras", rows.name, "worst"),
        index,
        rr.TextLog.columns(text=texts, level=["WARN"] * len(texts)),
    )
    _log_points(stream, rows, row, worst)
    first = np.append([True], np.diff(row) > 0)  # a frame has room for one mark: its largest
    marks = [f"#{n} {e:+.0f} %" for n, e in zip(number[first], worst.error[first], strict=True)]
    log_marks(stream, rows, "errors_worst", row[first], marks)


def _log_points(stream: rr.RecordingStream, rows: CameraRows, row: IntArray, worst: Worst) -> None:
    """Log the worst as points in the plot of errors; of one frame the largest."""
    first = np.append([True], np.diff(row) > 0)
    values = np.abs(worst.error[first])
    send_rows(
        stream,
        path("cameras", rows.name, "error", "worst"),
        (rows.frames, row[first]),
        lambda part: rr.Scalars.columns(scalars=values[part]),
        rr.SeriesPoints(
            names=["the worst, % of the depth"],
            colors=[ERROR],
            markers=["diamond"],
            marker_sizes=[5.0],
        ),
    )
