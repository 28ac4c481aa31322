"""The text panels of the timeline: what this recording is, and its tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from dashboards.scene import METHOD_ORDER

MAX_ROWS = 200


def markdown_safe(text: object) -> str:
    """Return text from a file that Markdown shows as it is."""
    shown = "".join(c if c.isprintable() else "?" for c in str(text))
    return "".join("\\" + c if c in "\\`*_{}[]()<>#+-.!|~" else c for c in shown)


def about_text(recording: Mapping[str, Any], frames: Mapping[str, pd.DataFrame]) -> str:
    """Return what recording, cameras and methods these are."""
    lines = [
        f"# {markdown_safe(recording['file_name'])}",
        f"{recording['frame_count']:,} frames, SHA-256 `{recording['content_sha256']}`",
    ]
    if recording["damaged"]:
        lines.append(f"**Damaged**: {recording['frames_lost']:,} frames were lost.")
    for camera in _records(frames["cameras"]):
        lines.append(f"## Camera {markdown_safe(camera['camera'])}")
        lines.append(_lens_text(camera))
        lines.append(_pose_text(camera))
    methods = [m for m in METHOD_ORDER if m in set(frames["estimates"]["method"])]
    lines.append("## Methods")
    lines.append(f"Used: {', '.join(methods) or 'none'}. The first is drawn.")
    lines.append(
        "Depth is along the optical axis. Intervals and bands hold 95 %, if the errors are normal. "
        "A height marked as assumed is the population's mean, not a measurement."
    )
    return "\n\n".join(line for line in lines if line)


def _lens_text(camera: Mapping[str, Any]) -> str:
    if pd.isna(camera["fx_px"]):
        return "No lens data: no distance can be told."
    source = {
        "recording": "from the recording",
        "camera_file": "from the camera file",
        "lens_data": "from focal length and pixel pitch",
    }.get(camera["intrinsics_source"], "")
    return (
        f"{camera['width_px']} x {camera['height_px']} px, focal length "
        f"{camera['fx_px']:.1f} x {camera['fy_px']:.1f} px {source}."
    )


def _pose_text(camera: Mapping[str, Any]) -> str:
    if pd.isna(camera["camera_height_m"]):
        return "The pose above the ground is not known."
    by = "found from the people who walk" if camera["pose_source"] == "walkers" else "given"
    return (
        f"{camera['camera_height_m']:.2f} ± {1.96 * camera['camera_height_std_m']:.2f} m above the "
        f"ground, tilted by {math.degrees(camera['tilt_rad']):.1f} ± "
        f"{1.96 * math.degrees(camera['tilt_std_rad']):.1f} degrees (95 %), {by}."
    )


def tracks_text(track_heights: pd.DataFrame) -> str:
    """Return a table of the tracks by the best method of each."""
    if track_heights.empty:
        return "No tracks."
    rank = {method: i for i, method in enumerate(METHOD_ORDER)}
    ordered = track_heights.assign(rank=track_heights["method"].map(rank).fillna(99))
    best = ordered.sort_values(["camera", "track_id", "rank"]).drop_duplicates(
        ["camera", "track_id"]
    )
    lines = [
        "| track | frames | depth m | height m (95 %) | method |",
        "|--:|--:|--:|--:|:--|",
    ]
    for row in _records(best.head(MAX_ROWS)):
        height = ""
        if pd.notna(row["height_m"]):
            height = f"{row['height_m']:.2f} ± {1.96 * row['height_std_m']:.2f}"
            height += " assumed" if row["height_assumed"] else ""
        depth = f"{row['depth_min_m']:.1f} to {row['depth_max_m']:.1f}"
        lines.append(
            f"| #{row['track_id']} | {row['observation_count']:,} | {depth} | {height} "
            f"| {row['method']} |"
        )
    if len(best) > MAX_ROWS:
        lines.append(f"\n{len(best) - MAX_ROWS:,} more are in the database.")
    return "\n".join(lines)


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return rows as dictionaries by column name."""
    return [{str(k): v for k, v in row.items()} for row in frame.to_dict("records")]
