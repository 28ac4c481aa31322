"""Text panels of the timeline: the recording, its cameras and methods, and its tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pyarrow as pa

from dashboards.style import Z_95
from dashboards.timeline.columns import CameraRows
from dashboards.timeline.names import markdown
from dashboards.timeline.slots import SLOTS
from pipeline import __version__
from pipeline.core.arrays import FloatArray
from pipeline.estimate.methods import IN_ORDER, NAMES, in_order

MAX_ROWS = 200
TEXT_COLUMNS = ("camera", "class", "method")
INTRINSICS_TEXTS = {
    "recording": "from the recording",
    "camera_file": "from the camera file",
    "lens_data": "from focal length and pixel pitch; its centre is assumed",
    "walkers": "found from the people who walk; its centre is assumed",
}
POSE_TEXTS = {"walkers": "found from the people who walk on it", "truth": "found from the truth"}


def about_text(
    recording: Mapping[str, Any], cameras: Sequence[CameraRows], tables: Mapping[str, pa.Table]
) -> str:
    """Return the panel About: recording, cameras, calibrations, methods, and how to read the views."""
    parts = [_recording_text(recording)]
    for rows in cameras:
        parts.append(_camera_text(rows))
    parts.append(_methods_text(cameras))
    calibrations = tables.get("calibrations")
    if calibrations is not None and calibrations.num_rows:
        parts.append(_calibrations_text(calibrations))
    if tables["diagnostics"].num_rows:
        parts.append(_diagnostics_text(tables["diagnostics"]))
    parts.append(_reading_text(cameras))
    return "\n\n".join(parts)


def _recording_text(recording: Mapping[str, Any]) -> str:
    lines = [f"### {markdown(recording['file_name'])}"]
    frames = recording.get("frame_count")
    start, end = recording.get("start_time_ns"), recording.get("end_time_ns")
    facts = [f"{frames:,} frames" if frames is not None else ""]
    if start is not None and end is not None:
        facts.append(f"{_clock(start)} to {_clock(end)} UTC ({(end - start) / 1e9:,.1f} s)")
    lines.append(", ".join(fact for fact in facts if fact))
    if recording.get("damaged"):
        lines.append(
            f"**Damaged**: {recording.get('frames_lost') or 0:,} frames were lost; see Diagnostics."
        )
    version = recording.get("software_version") or __version__
    made = f"stadimeter {markdown(version)}"
    if recording.get("run_id"):
        made += f", run `{markdown(recording['run_id'])}`"
    lines.append(f"Measured by {made}. Recording `{markdown(recording['recording_id'])}`.")
    return "\n\n".join(line for line in lines if line)


def _clock(time_ns: int) -> str:
    try:
        moment = datetime.fromtimestamp(time_ns / 1e9, UTC)
    except (OverflowError, ValueError, OSError):
        return f"{time_ns:,} ns"
    return moment.strftime("%Y-%m-%d %H:%M:%S")


def _camera_text(rows: CameraRows) -> str:
    camera = rows.camera
    lines = [f"#### Camera {markdown(rows.name)}", _lens_text(camera), _pose_text(camera)]
    rate_hz = rows.frames.rate_hz()
    seen = f"{len(rows.frames):,} frames"
    if rate_hz and not rows.is_series_of_pictures:
        seen += f" at {rate_hz:.3g} a second"
    things = f"{len(rows.observations):,} observations of {len(rows.tracks.track_id):,} tracks"
    lines.append(f"{seen}, {things}.")
    return "\n\n".join(lines)


def _lens_text(camera: Mapping[str, Any]) -> str:
    if camera["fx_px"] is None:
        return "No lens data: no distance can be estimated."
    source = INTRINSICS_TEXTS.get(camera["intrinsics_source"], "")
    lens = f"focal length {camera['fx_px']:.1f} x {camera['fy_px']:.1f} px"
    distorted = any(camera["distortion"] or [])
    note = (
        " Its distortion is corrected in all numbers, but not drawn in the scene."
        if distorted
        else ""
    )
    return f"{camera['width_px']} x {camera['height_px']} px, {lens} {source}.{note}"


def _pose_text(camera: Mapping[str, Any]) -> str:
    if camera["camera_height_m"] is None:
        return "The pose above the ground is not known; the scene is drawn around the optical axis."
    height = with_interval(camera["camera_height_m"], camera["camera_height_std_m"], 2)
    tilt = with_interval(_degrees(camera["tilt_rad"]), _degrees(camera["tilt_std_rad"]), 1)
    by = POSE_TEXTS.get(camera["pose_source"], "given")
    return f"{height} m above the ground, tilted down by {tilt} degrees (95 %), {by}."


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None else math.degrees(angle_rad)


def with_interval(value: float | None, std: float | None, digits: int) -> str:
    """Return a value with its 95 % interval, as far as they are known."""
    if value is None or not math.isfinite(value):
        return ""
    if std is None or not math.isfinite(std):
        return f"{value:.{digits}f}"
    return f"{value:.{digits}f} ± {Z_95 * std:.{digits}f}"


def _methods_text(cameras: Sequence[CameraRows]) -> str:
    used = {m: int((rows.best_method == m).sum()) for rows in cameras for m in rows.methods}
    if not used:
        return "#### Methods\n\nNo distance was estimated."
    lines = [
        "#### Methods",
        "Of these methods, the first that has a depth for an observation is drawn:",
    ]
    texts = {method.name: method.text for method in IN_ORDER}
    items = []
    for method in in_order(set(used)):
        drawn = sum(int((rows.best_method == method).sum()) for rows in cameras)
        text = texts.get(method, "")
        items.append(f"- **{markdown(method)}**: {text} (drawn: {drawn:,})")
    lines.append("\n".join(items))
    return "\n\n".join(lines)


def _calibrations_text(calibrations: pa.Table) -> str:
    lines = [
        "#### Calibrations",
        "| camera | class | side | method | parameter | value | source |\n|:--|:--|:--|:--|:--|--:|:--|",
    ]
    for row in calibrations.slice(0, MAX_ROWS).to_pylist():
        at = f" at f/{row['f_number']:g}" if row["f_number"] is not None else ""
        cells = (row["camera"] or "any", row["object_class"], row["dimension"], row["method"])
        value = with_interval(row["value"], row["std_error"], 4)
        named = [markdown(cell) for cell in cells]
        lines[-1] += (
            f"\n| {' | '.join(named)} | {markdown(row['parameter'])}{at} | {value} "
            f"| {markdown(row['source'] or '')} |"
        )
    return "\n\n".join(lines)


def _diagnostics_text(diagnostics: pa.Table) -> str:
    """Return the diagnostics, a line for each kind: also of a recording without frames."""
    kinds: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in diagnostics.to_pylist():
        kinds.setdefault((row["severity"], row["code"]), []).append(row)
    lines = []
    for (severity, code), rows in sorted(kinds.items())[:MAX_ROWS]:
        times = sum(row["count"] for row in rows)
        lines.append(
            f"- **{markdown(code)}** ({markdown(severity)}, {times:,} times): "
            f"{markdown(rows[0]['message'])}"
        )
    return "\n\n".join(["#### Diagnostics", "\n".join(lines)])


def _reading_text(cameras: Sequence[CameraRows]) -> str:
    lines = [
        "#### Notes for reading",
        "Depth is the distance along the optical axis. Intervals and bands are 95 % intervals for "
        "normal errors: 1.96 standard deviations to either side. Rerun calls the square of that half "
        "width the variance of a curve.",
        'A label has the number of the track, its depth and its height. "height assumed" marks a '
        "height that was assumed, not measured; such a height is in no curve.",
        '"Not one object" marks a height that is impossible for one object of its class: two people '
        "in one box, or half a person.",
        "Ground truth is white; where the true size of an object is not known its outline has the "
        "estimated size. Boxes, bodies, trails, curves and bars of one track have one colour; a track "
        "that begins after another has ended may have the same colour.",
        "A bar shows the state of its track: seen; hidden (head or feet cannot be seen: behind "
        "something, or outside the picture); or predicted, between frames in which it was seen.",
    ]
    without = sum(int((rows.tracks.slot < 0).sum()) for rows in cameras)
    if without:
        lines.append(
            f"{without:,} tracks are in the picture, the scene and the database, but not in the plots: "
            f"{SLOTS} others were there at the same time."
        )
    return "\n\n".join(lines)


def tracks_text(tables: Mapping[str, pa.Table], cameras: Sequence[CameraRows]) -> str:
    """Return a table of the tracks, each by its best method, the longest first if there are many."""
    rank = {name: i for i, name in enumerate(NAMES)}
    best: dict[tuple[str, int], dict[str, Any]] = {}
    for row in tables["track_heights"].to_pylist():
        key = (row["camera"], row["track_id"])
        if key not in best or rank.get(row["method"], 99) < rank.get(best[key]["method"], 99):
            best[key] = row
    if not best:
        return _tracks_without_distance(tables["tracks"])
    about = {(row["camera"], row["track_id"]): row for row in tables["tracks"].to_pylist()}
    true = _true_of_tracks(cameras)
    head = ["camera"] if len(cameras) > 1 else []
    head += ["track", "class", "frames", "first", "last", "depth, m", "height, m (95 %)", "method"]
    head += ["true height, m", "depth error"] if true else []
    lines = [
        _table_row(head),
        _table_row([":--" if h in TEXT_COLUMNS else "--:" for h in head]),
    ]
    rows = sorted(best.items())
    if len(rows) > MAX_ROWS:
        rows = sorted(sorted(rows, key=lambda r: -r[1]["observation_count"])[:MAX_ROWS])
    for (camera, track_id), row in rows:
        track = about.get((camera, track_id), {})
        cells = [markdown(camera)] if len(cameras) > 1 else []
        cells += [
            f"#{track_id}",
            markdown(track.get("class_name") or ""),
            f"{row['observation_count']:,}",
            str(track.get("first_frame_index", "")),
            str(track.get("last_frame_index", "")),
            _range_text(row["depth_min_m"], row["depth_max_m"]),
            _height_text(row),
            markdown(row["method"]),
        ]
        cells += true.get((camera, track_id), ("", "")) if true else []
        lines.append(_table_row(cells))
    if len(best) > MAX_ROWS:
        lines.append(f"\nThe {MAX_ROWS} longest of {len(best):,}; the others are in the database.")
    return "\n".join(lines)


def _tracks_without_distance(tracks: pa.Table) -> str:
    """Return a list of the tracks where no method applies to any."""
    lines = [
        "No track has a distance: no method applies. The tab About shows the lens and pose data."
    ]
    if tracks.num_rows:
        head = ["camera", "track", "class", "frames", "first", "last"]
        lines += ["", _table_row(head), _table_row([":--"] * len(head))]
    for row in tracks.slice(0, MAX_ROWS).to_pylist():
        named = (markdown(row["camera"]), f"#{row['track_id']}", markdown(row["class_name"] or ""))
        numbers = (row["observation_count"], row["first_frame_index"], row["last_frame_index"])
        lines.append(_table_row([*named, *map(str, numbers)]))
    return "\n".join(lines)


def _true_of_tracks(cameras: Sequence[CameraRows]) -> dict[tuple[str, int], tuple[str, str]]:
    """Return the true height of each matched track, and the median error of its depth."""
    found = {}
    for rows in cameras:
        if rows.matched is None:
            continue
        off = 100 * (rows.best.depth_m / rows.matched.depth_m - 1)
        order = np.argsort(rows.observations.track, kind="stable")
        edges = np.searchsorted(
            rows.observations.track[order], np.arange(len(rows.tracks.track_id) + 1)
        )
        for i, track_id in enumerate(rows.tracks.track_id.tolist()):
            mine = order[edges[i] : edges[i + 1]]
            height_m, depth_off = rows.matched.height_m[mine], off[mine]
            cells = (_median_text(height_m, ".2f", ""), _median_text(depth_off, "+.1f", " %"))
            found[str(rows.camera["camera"]), track_id] = cells
    return found


def _median_text(values: FloatArray, form: str, unit: str) -> str:
    known = values[np.isfinite(values)]
    return f"{np.median(known):{form}}{unit}" if len(known) else ""


def _height_text(row: Mapping[str, Any]) -> str:
    is_fine = row["height_std_m"] is not None and Z_95 * row["height_std_m"] < 0.03
    text = with_interval(row["height_m"], row["height_std_m"], 3 if is_fine else 2)
    if text and row["height_assumed"]:
        return f"{text} assumed"
    if text and row.get("height_plausible") is False:
        return f"{text}: not one object"
    return text


def _range_text(low_m: float | None, high_m: float | None) -> str:
    if low_m is None or high_m is None:
        return ""
    digits = 1 if high_m >= 3 else 2
    low, high = f"{low_m:.{digits}f}", f"{high_m:.{digits}f}"
    return low if low == high else f"{low} to {high}"


def _table_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
