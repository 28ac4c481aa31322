"""Exposure over time: how the camera was set, and how bright the pictures came out."""

from __future__ import annotations

import numpy as np
import rerun as rr

from dashboards.style import PALETTE
from dashboards.timeline.columns import Frames, floats
from dashboards.timeline.names import path
from dashboards.timeline.stream import send_rows
from pipeline.core.arrays import FloatArray, IntArray

# What each curve shows, in the order of the panels: title with its unit, and its scale.
EXPOSURE = {
    "ev100": ("Exposure value at ISO 100, EV", 1.0),
    "iso_speed": ("Sensitivity, ISO", 1.0),
    "exposure_time_s": ("Shutter, ms", 1e3),
    "f_number": ("Aperture, f-number", 1.0),
    "luminance": ("Picture luminance, % of full scale", 100.0),
    "scene_luminance_cd_m2": ("Scene luminance, cd/m²", 1.0),
}


def log_exposure(stream: rr.RecordingStream, name: str, frames: Frames) -> None:
    """Log each value where it is known."""
    for i, (column, (values, known)) in enumerate(exposure_curves(frames).items()):
        send_rows(
            stream,
            path("cameras", name, "exposure", column),
            (frames, known),
            lambda part, values=values[known]: rr.Scalars.columns(  # type: ignore[misc]
                scalars=values[part]
            ),
            rr.SeriesLines(
                names=[EXPOSURE[column][0]], colors=[PALETTE[i % len(PALETTE)]], widths=[1.5]
            ),
        )


def exposure_curves(frames: Frames) -> dict[str, tuple[FloatArray, IntArray]]:
    """Return the values that are known of any frame, and where."""
    curves = {}
    for column, (_, scale) in EXPOSURE.items():
        values = floats(frames.table, column) * scale
        known = np.flatnonzero(np.isfinite(values))
        if len(known):
            curves[column] = (values, known)
    return curves
