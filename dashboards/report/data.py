"""Rows of the report, read from the database by SQL: small tables, however large the database is."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.estimate.methods import NAMES
from pipeline.store.database import Store

Row = dict[str, Any]

# More points than this make a chart slow to move about in, and show no more.
POINTS_A_METHOD = 2_000
POSITIONS_SHOWN = 4_000
TRACKS_SHOWN = 60
PEOPLE_SHOWN = 600  # of all cameras, but three of each
INSTANTS_SHOWN = 400  # steps of time in the chart of exposure, a camera
WORST_SHOWN = 15
DIAGNOSTICS_SHOWN = 200
DIGITS = 5  # significant digits of the numbers behind a chart


@dataclass(frozen=True, slots=True)
class ReportData:
    """Rows for each part of the report; empty where there is nothing to show."""

    recordings: list[Row]
    cameras: list[Row]
    runs: list[Row]
    calibrations: list[Row]
    by_method: list[Row]
    by_range: list[Row]
    by_aperture: list[Row]
    heights_by_method: list[Row]
    coverage: list[Row]
    matching: list[Row]
    errors: list[Row]  # a sample
    error_count: int
    worst: list[Row]
    comparison: list[Row]
    track_heights: list[Row]
    track_count: int
    positions: list[Row]  # a sample
    exposure: list[Row]
    people: list[Row]  # as many as `track_heights`, with the frame that shows each best
    diagnostics: list[Row]
    diagnostic_count: int


def read_report_data(store: Store) -> ReportData:
    """Ask everything that the report shows of a database that is open for reading."""
    accuracy = _accuracy(store)
    error_count = max((r["depth_count"] for r in accuracy["by_method"]), default=0)
    return ReportData(
        recordings=_rows(store, "FROM recordings ORDER BY file_name, recording_id"),
        cameras=_rows(store, _CAMERAS),
        runs=_runs(store),
        calibrations=_rows(store, _CALIBRATIONS),
        by_method=accuracy["by_method"],
        by_range=accuracy["by_range"],
        by_aperture=accuracy["by_aperture"],
        heights_by_method=accuracy["heights_by_method"],
        coverage=accuracy["coverage"],
        matching=_rows(store, "FROM accuracy.matching WHERE truth_count > 0"),
        errors=_rows(store, _ERRORS, [min(1.0, POINTS_A_METHOD / max(error_count, 1))]),
        error_count=error_count,
        worst=_rows(store, _WORST, [WORST_SHOWN]),
        comparison=_rows(store, "FROM paper.comparison") if accuracy["by_method"] else [],
        track_heights=_rows(store, f"{_TRACK_HEIGHTS} {_IN_ORDER}", [TRACKS_SHOWN]),
        track_count=_count(store, _TRACK_COUNT),
        positions=_positions(store),
        exposure=_rows(store, _EXPOSURE, [INSTANTS_SHOWN]),
        people=_rows(store, _PEOPLE, [_people_a_camera(store)]),
        diagnostics=_rows(store, _DIAGNOSTICS, [DIAGNOSTICS_SHOWN]),
        diagnostic_count=_count(store, f"SELECT count(*) AS n FROM ({_GROUPED})"),
    )


def _rows(store: Store, sql: str, parameters: list[object] | None = None) -> list[Row]:
    found: list[Row] = store.query(sql, parameters or []).to_pylist()
    return found


def _count(store: Store, sql: str) -> int:
    return int(_rows(store, sql)[0]["n"])


def _people_a_camera(store: Store) -> int:
    """Return how many tracks of each camera are listed: the page is read by people."""
    cameras = max(_count(store, "SELECT count(*) AS n FROM cameras"), 1)
    return min(max(PEOPLE_SHOWN // cameras, 3), TRACKS_SHOWN)


def _accuracy(store: Store) -> dict[str, list[Row]]:
    """Return the rows of the views of `_ACCURACY`, by name."""
    (found,) = _rows(store, _ACCURACY)
    return {name: rows or [] for name, rows in found.items()}


def _runs(store: Store) -> list[Row]:
    """Return the runs with their libraries and configuration as text to read."""
    runs = _rows(store, "FROM runs WHERE run_id IN (FROM main.current_run SELECT run_id)")
    for run in runs:
        libraries = _parsed(run["libraries"])
        run["libraries"] = ", ".join(f"{name} {version}" for name, version in libraries.items())
        run["configuration"] = json.dumps(_parsed(run["configuration"]), indent=1)
    return runs


def _parsed(text: str | None) -> Mapping[str, Any]:
    try:
        found = json.loads(text or "{}")
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _positions(store: Store) -> list[Row]:
    total = _count(store, f"SELECT count(*) AS n FROM ({_PLACED})")
    share = min(1.0, POSITIONS_SHOWN / max(total, 1))
    return _rows(store, _POSITIONS, [share])


def rounded(rows: list[Row]) -> list[Row]:
    """Return rows for a chart: numbers to a few digits, what is not finite as null."""
    return [{name: _rounded(value) for name, value in row.items()} for row in rows]


def _rounded(value: object) -> object:
    if not isinstance(value, float):
        return value
    return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None


def _ranked(method: str) -> str:
    order = ", ".join(f"'{name}'" for name in NAMES)
    return f"coalesce(list_position([{order}], {method}), 99)"


# A part of the rows that is the same at every asking: those whose hash is below a share of all.
_SAMPLED = "hash({key}) <= ? * 18446744073709551615::DOUBLE"

# Those of accuracy.by_method, by_range, by_aperture, height_by_method and coverage, in one statement:
# all estimates are read once, not once a view.
_ACCURACY = """
WITH sums AS MATERIALIZED (FROM accuracy.sums(['aperture', 'depth'])),
metrics AS MATERIALIZED (FROM accuracy.from_sums('sums', []))
SELECT
    (
        SELECT list(m ORDER BY camera, depth_rmse_m, method)
        FROM accuracy.from_sums('sums', ['camera']) AS m
    ) AS by_method,
    (
        SELECT list(m ORDER BY camera, true_depth_from_m, method)
        FROM accuracy.from_sums('sums', ['camera', 'depth']) AS m WHERE depth_count > 0
    ) AS by_range,
    (
        SELECT list(m ORDER BY camera, f_number, method)
        FROM accuracy.from_sums('sums', ['camera', 'aperture']) AS m WHERE depth_count > 0
    ) AS by_aperture,
    (
        SELECT list(m ORDER BY method, unit) FROM accuracy.heights_from_metrics('metrics') AS m
    ) AS heights_by_method,
    (
        SELECT list(m ORDER BY quantity, method, nominal)
        FROM accuracy.coverage_from_sums('sums') AS m
    ) AS coverage
"""

_ERRORS = f"""
SELECT
    method, file_name, camera, frame_index, track_id, object_id, f_number,
    strftime(make_timestamp_ns(capture_time_ns), '%Y-%m-%d %H:%M:%S.%g') AS captured_at,
    (capture_time_ns - started_ns) / 1e9 AS time_s,
    true_depth_m, depth_m, depth_error_m,
    (depth_m + true_depth_m) / 2 AS mean_depth_m,
    depth_m - 1.959964 * depth_std_m AS depth_low_m,
    depth_m + 1.959964 * depth_std_m AS depth_high_m
FROM accuracy.errors
JOIN (
    SELECT recording_id, min(capture_time_ns) AS started_ns FROM frames GROUP BY recording_id
) USING (recording_id)
WHERE depth_error_m IS NOT NULL
    AND {_SAMPLED.format(key="recording_id || camera || observation_index")}
ORDER BY method, recording_id, capture_time_ns, track_id
"""

_WORST = """
SELECT * FROM accuracy.worst
WHERE depth_error_m IS NOT NULL
ORDER BY abs(depth_z) DESC NULLS LAST, abs(depth_relative_error) DESC
LIMIT ?
"""

_CAMERAS = """
SELECT r.file_name, c.* FROM cameras c JOIN recordings r USING (recording_id)
ORDER BY file_name, camera
"""

_CALIBRATIONS = """
SELECT DISTINCT * EXCLUDE (calibration_id, run_id) FROM calibrations
WHERE calibration_id IN (
    SELECT DISTINCT calibration_id FROM estimates
    SEMI JOIN main.current_run USING (recording_id, run_id)
)
ORDER BY ALL
"""

_TRACKS = f"""
SELECT
    r.file_name, h.camera, h.track_id, t.class_name, h.method, h.observation_count,
    h.height_m, h.height_std_m, h.height_assumed, h.height_plausible,
    h.depth_min_m, h.depth_max_m, truth.true_height_m, recording_id
FROM track_heights h
SEMI JOIN main.current_run USING (recording_id, run_id)
JOIN recordings r USING (recording_id)
JOIN tracks t USING (recording_id, camera, track_id)
LEFT JOIN (
    SELECT recording_id, camera, track_id, median(true_height_m) AS true_height_m
    FROM matches GROUP BY ALL
) truth USING (recording_id, camera, track_id)
WHERE h.height_m IS NOT NULL
QUALIFY row_number() OVER (
    PARTITION BY recording_id, h.camera, h.track_id ORDER BY {_ranked("h.method")}
) = 1
"""

_TRACK_HEIGHTS = f"""
SELECT
    *, height_m - 1.959964 * height_std_m AS height_low_m,
    height_m + 1.959964 * height_std_m AS height_high_m
FROM ({_TRACKS})
QUALIFY row_number() OVER (
    PARTITION BY recording_id, camera ORDER BY observation_count DESC, track_id
) <= ?
"""

_IN_ORDER = "ORDER BY file_name, camera, track_id"

# The frame that shows a track best: the tallest box that is whole, uncovered and measured.
_PEOPLE = f"""
WITH shown AS ({_TRACK_HEIGHTS}), depths AS (
    SELECT
        e.recording_id, o.camera, o.track_id, median(e.depth_m) AS depth_m,
        median(e.depth_std_m / e.depth_m) AS share,
        arg_max(
            {{'frame_index': o.frame_index, 'x_min_px': o.x_min_px, 'y_min_px': o.y_min_px,
              'x_max_px': o.x_max_px, 'y_max_px': o.y_max_px}},
            (o.y_max_px - o.y_min_px) * (1 - coalesce(o.occlusion, 0))
            * CASE WHEN o.truncated_left OR o.truncated_top OR o.truncated_right
                OR o.truncated_bottom OR NOT coalesce(o.measured, true) THEN 0.01 ELSE 1 END
        ) AS best
    FROM (
        SELECT o.*, s.method FROM observations AS o JOIN shown AS s
            ON s.recording_id = o.recording_id AND s.camera = o.camera AND s.track_id = o.track_id
    ) AS o
    JOIN estimates AS e ON e.recording_id = o.recording_id
        AND e.observation_index = o.observation_index AND e.method = o.method
    SEMI JOIN main.current_run AS c ON c.recording_id = e.recording_id AND c.run_id = e.run_id
    WHERE e.depth_m > 0
    GROUP BY ALL
)
SELECT
    s.*, d.depth_m, d.depth_m * exp(-1.959964 * d.share) AS depth_low_m,
    d.depth_m * exp(1.959964 * d.share) AS depth_high_m, d.best
FROM shown AS s LEFT JOIN depths AS d USING (recording_id, camera, track_id)
ORDER BY file_name, camera, track_id
"""

_TRACK_COUNT = f"SELECT count(*) AS n FROM ({_TRACKS})"

_PLACED = """
SELECT * FROM main.current_estimates
WHERE x_m IS NOT NULL AND y_m IS NOT NULL AND (recording_id, camera) IN (
    SELECT (recording_id, camera) FROM cameras WHERE camera_height_m IS NOT NULL
)
"""

_POSITIONS = f"""
SELECT
    r.file_name, camera, track_id, frame_index, method, x_m, y_m, depth_m,
    camera || ' #' || track_id AS track
FROM ({_PLACED}) JOIN recordings r USING (recording_id)
WHERE {_SAMPLED.format(key="recording_id || camera || frame_index")}
QUALIFY row_number() OVER (
    PARTITION BY recording_id, observation_index ORDER BY {_ranked("method")}
) = 1
ORDER BY file_name, camera, track_id, frame_index
"""

_EXPOSURE = """
WITH timed AS (
    SELECT
        *, (capture_time_ns - min(capture_time_ns) OVER camera_of) / 1e9 AS since_s,
        (max(capture_time_ns) OVER camera_of - min(capture_time_ns) OVER camera_of) / 1e9 AS long_s
    FROM frames
    WINDOW camera_of AS (PARTITION BY recording_id, camera)
)
SELECT
    r.file_name, camera, min(frame_index) AS frame_index, avg(since_s) AS time_s,
    avg(ev100) AS ev100, avg(f_number) AS f_number, avg(iso_speed) AS iso_speed,
    avg(exposure_time_s) AS exposure_time_s, avg(luminance) AS luminance,
    avg(clipped_fraction) AS clipped_fraction
FROM timed JOIN recordings r USING (recording_id)
GROUP BY r.file_name, recording_id, camera, floor(? * since_s / greatest(long_s, 1e-9))
ORDER BY file_name, camera, time_s
"""

# What is said of several recordings, cameras or runs in the same words is one row.
_GROUPED = """
SELECT
    severity, code, message, sum(count)::BIGINT AS count,
    list(DISTINCT file_name ORDER BY file_name) FILTER (file_name IS NOT NULL) AS file_names,
    list(DISTINCT coalesce(camera, topic)) FILTER (coalesce(camera, topic) IS NOT NULL) AS places,
    min(byte_offset) AS byte_offset, min(log_time_ns) AS log_time_ns
FROM diagnostics
WHERE recording_id IS NULL OR run_id IN (FROM main.current_run SELECT run_id)
    OR run_id IN (FROM recordings SELECT run_id)
GROUP BY severity, code, message
"""
_DIAGNOSTICS = f"""
FROM ({_GROUPED})
ORDER BY list_position(['error', 'warning', 'info'], severity), file_names, log_time_ns, code
LIMIT ?
"""
