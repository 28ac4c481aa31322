"""Whose word counts for the lens of a stored camera, as a row of the table `cameras`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from pipeline.calibrate.camera_entry import is_unsure
from pipeline.core.config import CameraConfig
from pipeline.core.exposure import Exposure
from pipeline.core.lens import intrinsics_of, lens_of
from pipeline.core.records import FoundLens, GroundPlane

_NO_LENS = dict.fromkeys(
    ("fx_px", "fy_px", "cx_px", "cy_px", "distortion_model", "distortion", "focal_std_px")
)


def known_lens(row: Mapping[str, Any], camera: CameraConfig) -> dict[str, Any]:
    """Return a stored camera with the lens that is known without its pose.

    What was found from walkers is looked for again, also where a camera file carries it without the
    pose it goes with. What the recording does not tell may stand in the camera file since its pictures
    were read.
    """
    bare = {**row, **_NO_LENS, "intrinsics_source": None}
    posed = not math.isnan(camera.camera_height_m) and not math.isnan(camera.tilt_deg)
    if row["fx_px"] is not None and row["intrinsics_source"] != "walkers":
        if not is_unsure(camera, row):
            return {**row, "focal_std_px": None}
        return {**row, "focal_std_px": camera.focal_std_px} if posed else bare
    if camera.focal_std_px > 0 and not posed:
        return bare
    width_px, height_px = row["width_px"], row["height_px"]
    if not (width_px and height_px):
        return bare
    lens = lens_of(Exposure(), camera, None, width_px, height_px)
    found, source, _ = intrinsics_of(None, camera, lens, width_px, height_px)
    if found is None or not math.isfinite(found.fx_px):
        return bare
    return {
        **bare,
        "fx_px": found.fx_px,
        "fy_px": found.fy_px,
        "cx_px": found.cx_px,
        "cy_px": found.cy_px,
        "distortion_model": found.distortion_model,
        "distortion": list(found.distortion),
        "intrinsics_source": source,
        "focal_std_px": (camera.focal_std_px or None) if source == "camera_file" else None,
    }


def with_found(row: Mapping[str, Any], lens: FoundLens) -> dict[str, Any]:
    """Return a stored camera with a lens that was found from walkers."""
    k = lens.intrinsics
    return {
        **row,
        **{"fx_px": k.fx_px, "fy_px": k.fy_px, "cx_px": k.cx_px, "cy_px": k.cy_px},
        "distortion_model": "",
        "distortion": [],
        "focal_std_px": lens.std_px,
        "intrinsics_source": "walkers",
    }


def with_doubt(row: Mapping[str, Any], plane: GroundPlane) -> dict[str, Any]:
    """Return a stored camera with how unsure a pose makes its focal length, if it does."""
    if plane.focal_covariance is None:
        return dict(row)
    return {**row, "focal_std_px": row["fx_px"] * math.sqrt(plane.focal_covariance[3])}
