"""A pose, and a lens found with it, as a camera file says them: standard errors and correlations.

How far depths are off follows from how the errors go together: a camera that is believed too high and
too steep sees people at the right distance. So the correlations stand beside the standard errors.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.core.camera_row import CameraRow
from pipeline.core.config import CameraConfig
from pipeline.core.records import FoundLens, GroundPlane

_ABOVE_DIAGONAL = np.triu_indices(3, 1)
# Distance of the principal point from the middle of the picture, up or down, as a share of its width.
# Published calibrations: EuRoC MAV 1.1 and 2.0 %, TUM RGB-D 2.4, 1.6 and 1.3 %; their root mean square.
CENTRE_STD = 0.0175


def given_pose(camera: CameraConfig, row: CameraRow) -> GroundPlane | None:
    """Return the pose that a camera file gives, or None if it gives none.

    Args:
        camera: its entry.
        row: the camera, of the table `cameras`: the file's focal length may not be the one in use.
    """
    if math.isnan(camera.camera_height_m) or math.isnan(camera.tilt_deg):
        return None
    std = np.array(
        [
            camera.camera_height_std_m,
            math.radians(camera.tilt_std_deg),
            math.radians(camera.roll_std_deg),
        ]
    )
    correlation = np.eye(3)
    if camera.pose_correlation:
        correlation[_ABOVE_DIAGONAL] = correlation.T[_ABOVE_DIAGONAL] = camera.pose_correlation
    with_focal = None
    if is_unsure(camera, row):
        relative = camera.focal_std_px / camera.fx_px
        shared = np.array(camera.focal_correlation or np.zeros(3))
        with_focal = np.append(shared * std * relative, relative**2)
    return GroundPlane(
        camera.camera_height_m,
        math.radians(camera.tilt_deg),
        math.radians(camera.roll_deg),
        correlation * np.outer(std, std),
        "given",
        with_focal,
    )


def with_assumed_centre(plane: GroundPlane, row: CameraRow, camera: CameraConfig) -> GroundPlane:
    """Return a measured pose with what an assumed principal point adds to its tilt.

    A point that is y rows below the middle makes the axis of the picture's middle steeper by y / f than
    the surveyed one. A pose that walkers told (it has correlations) was fitted with this very centre.
    """
    if row.centre_source != "assumed" or camera.pose_correlation or row.fy_px is None:
        return plane
    covariance = plane.covariance.copy()
    covariance[1, 1] += (CENTRE_STD * (row.width_px or 0) / row.fy_px) ** 2
    return replace(plane, covariance=covariance)


def is_unsure(camera: CameraConfig, row: CameraRow) -> bool:
    """Return whether the lens in use is one of the camera file that walkers told."""
    return (
        row.intrinsics_source == "camera_file"
        and row.fx_px is not None
        and camera.focal_std_px > 0
        and math.isclose(row.fx_px, camera.fx_px, rel_tol=1e-6)
    )


def as_given(name: str, plane: GroundPlane, lens: FoundLens | None) -> CameraConfig:
    """Return the entry of a camera file for a pose, and for a lens that was found with it."""
    std = np.sqrt(np.diag(plane.covariance))
    apart = np.where(std > 0, std, 1.0)
    correlation = plane.covariance / np.outer(apart, apart)
    camera = CameraConfig(
        name,
        camera_height_m=plane.camera_height_m,
        camera_height_std_m=float(std[0]),
        tilt_deg=math.degrees(plane.tilt_rad),
        tilt_std_deg=math.degrees(std[1]),
        roll_deg=math.degrees(plane.roll_rad),
        roll_std_deg=math.degrees(std[2]),
        pose_correlation=tuple(correlation[_ABOVE_DIAGONAL].tolist()),
    )
    if lens is None:
        return camera
    k = lens.intrinsics
    found: dict[str, Any] = {"fx_px": k.fx_px, "fy_px": k.fy_px, "cx_px": k.cx_px, "cy_px": k.cy_px}
    if plane.focal_covariance is not None:
        relative = math.sqrt(plane.focal_covariance[3])
        shared = plane.focal_covariance[:3] / (apart * relative)
        found["focal_std_px"] = k.fx_px * relative
        found["focal_correlation"] = tuple(shared.tolist())
    return replace(camera, **found)
