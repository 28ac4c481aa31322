"""Choice of the source that counts for a stored camera's lens, as a row of the table `cameras`."""

from __future__ import annotations

import math
from dataclasses import replace

from pipeline.calibrate.camera_entry import is_unsure
from pipeline.core.camera_row import CameraRow
from pipeline.core.config import CameraConfig
from pipeline.core.exposure import Exposure
from pipeline.core.lens import intrinsics_of, lens_of, lens_sources
from pipeline.core.records import FoundLens, GroundPlane, Intrinsics


def known_lens(row: CameraRow, camera: CameraConfig) -> CameraRow:
    """Return a stored camera with the lens that is known without its pose.

    What was found from walkers is looked for again, also where a camera file carries it without the
    pose it goes with. What the recording does not tell may stand in the camera file since its pictures
    were read.
    """
    bare = row.with_lens(None, None)
    posed = not math.isnan(camera.camera_height_m) and not math.isnan(camera.tilt_deg)
    stated = math.isfinite(camera.fx_px) and (posed or camera.focal_std_px == 0)
    if row.intrinsics_source == "recording" and stated and row.size_px is not None:
        lens = lens_of(Exposure(), camera, row.intrinsics, *row.size_px)
        found, source, _ = intrinsics_of(row.intrinsics, camera, lens, *row.size_px)
        of_rest = lens_sources(found, camera, source) if found else (None, None)
        return row.with_lens(found, source, camera.focal_std_px or None, of_rest)
    if row.fx_px is not None and row.intrinsics_source != "walkers":
        if not is_unsure(camera, row):
            return replace(row, focal_std_px=None)
        return replace(row, focal_std_px=camera.focal_std_px) if posed else bare
    if (camera.focal_std_px > 0 and not posed) or row.size_px is None:
        return bare
    lens = lens_of(Exposure(), camera, None, *row.size_px)
    found, source, _ = intrinsics_of(None, camera, lens, *row.size_px)
    if found is None or not math.isfinite(found.fx_px):
        return bare
    unsure_px = (camera.focal_std_px or None) if source == "camera_file" else None
    return row.with_lens(found, source, unsure_px, lens_sources(found, camera, source))


def with_found(row: CameraRow, lens: FoundLens) -> CameraRow:
    """Return a stored camera with a lens that was found from walkers."""
    k = lens.intrinsics
    plain = Intrinsics(k.width_px, k.height_px, k.fx_px, k.fy_px, k.cx_px, k.cy_px)
    return row.with_lens(plain, "walkers", lens.std_px)


def with_doubt(row: CameraRow, plane: GroundPlane) -> CameraRow:
    """Return a stored camera with how unsure a pose makes its focal length, if it does."""
    if plane.focal_covariance is None or row.fx_px is None:
        return row
    return replace(row, focal_std_px=row.fx_px * math.sqrt(plane.focal_covariance[3]))
