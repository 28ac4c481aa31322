"""Exposure: stadimeter.CameraExposure, and any JSON object with the same names."""

from __future__ import annotations

from collections.abc import Collection

from pipeline.core.exposure import check_exposure
from pipeline.messages.content import Decoded
from pipeline.messages.tree import Tree, as_number, frame_id_of, time_of

# By name in the message: the field of `pipeline.core.records.Exposure`.
EXPOSURE_NAMES = {
    "exposure_time_s": "exposure_time_s",
    "f_number": "f_number",
    "photographic_sensitivity": "iso_speed",
    "exposure_bias_ev": "exposure_bias_ev",
    "focal_length_mm": "focal_length_mm",
    "focus_distance_m": "focus_distance_m",
    "gain_db": "gain_db",
    "digital_zoom_ratio": "digital_zoom_ratio",
    "pixel_pitch_x_um": "pixel_pitch_x_um",
    "pixel_pitch_y_um": "pixel_pitch_y_um",
    "sensor_width_px": "sensor_width_px",
    "sensor_height_px": "sensor_height_px",
}


def camera_exposure(tree: Tree) -> Decoded:
    """Return the values that are stated and possible."""
    stated = {
        field: as_number(tree[name])
        for name, field in EXPOSURE_NAMES.items()
        if tree.get(name) is not None
    }
    exposure, refused = check_exposure(stated)
    return Decoded(time_of(tree), frame_id_of(tree), exposure, refused, "invalid_exposure")


def names_exposure(names: Collection[str]) -> bool:
    """Whether an object with these names is an exposure: a name with its unit is hardly chance."""
    return any(name in names for name in EXPOSURE_NAMES)
