"""Pass 2: the columns of one stored recording become depths and heights. No picture is read.

stored measurements -> pose of the camera -> every method that applies -> estimates
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.calibrate.walkers import WalkersReport, calibrate_from_walkers
from pipeline.config import CameraConfig, Config
from pipeline.errors import CalibrationUndetermined
from pipeline.estimate.columns import Measured
from pipeline.estimate.combine import estimate, measured_by_camera
from pipeline.exposure_check import exposure_notes
from pipeline.records import Diagnostic, FloatArray, GroundPlane, Severity
from pipeline.store.database import Store


def estimate_recording(
    store: Store, recording_id: str, run_id: str, file_name: str, config: Config
) -> None:
    """Estimate a stored recording by every method and store the results, inside a transaction."""
    tables = {t: store.read(t, recording_id) for t in ("observations", "frames", "cameras")}
    notes = exposure_notes(store.exposure_verdicts(recording_id))
    poses: dict[str, GroundPlane] = {}
    edges = store.read("background_lines", recording_id)
    recorded = {row["camera"]: row for row in tables["cameras"].to_pylist()}
    for measured in measured_by_camera(**tables, poses={}):
        lines_px = lines_of(edges, measured.camera)
        plane = _pose(measured, recorded.get(measured.camera), lines_px, config, notes)
        if plane is not None:
            poses[measured.camera] = plane
            store.set_pose(recording_id, measured.camera, plane)
    result = estimate(**tables, poses=poses, config=config)
    store.write_estimates(
        recording_id,
        run_id,
        result.estimates,
        result.track_heights,
        result.calibrations,
        result.quality,
    )
    store.add_diagnostics([*notes, *result.diagnostics], recording_id, run_id, file_name)


def lines_of(edges: pa.Table, camera: str) -> FloatArray:
    """Return a camera's rows of the table `background_lines` as x0 y0 x1 y1, (n, 4)."""
    mine = edges.filter(pc.equal(edges["camera"], camera))
    names = ("x0_px", "y0_px", "x1_px", "y1_px")
    return np.stack([mine[n].to_numpy() for n in names], axis=1).astype(np.float64)


def _pose(
    measured: Measured,
    recorded: Mapping[str, Any] | None,
    lines_px: FloatArray,
    config: Config,
    notes: list[Diagnostic],
) -> GroundPlane | None:
    """Return the camera's pose.

    As the camera file gives it, else by the recording's transforms, else from the people who walk.
    """
    given = given_pose(config.camera_named(measured.camera))
    if given is None and recorded is not None:
        given = recorded_pose(recorded)
    if given is not None or measured.intrinsics is None:
        return given
    prior = config.stature
    if prior is None or not (measured.class_name == prior.object_class).any():
        return None
    try:
        plane, report = calibrate_from_walkers(measured, prior, lines_px=lines_px)
    except CalibrationUndetermined as error:
        notes.append(
            Diagnostic(Severity.INFO, "pose_undetermined", error.problem, camera=measured.camera)
        )
        return None
    notes.append(_describe(measured.camera, plane, report))
    return plane


def given_pose(camera: CameraConfig) -> GroundPlane | None:
    """Return the pose that a camera file gives, or None if it gives none."""
    if math.isnan(camera.camera_height_m) or math.isnan(camera.tilt_deg):
        return None
    std = np.array(
        [
            camera.camera_height_std_m,
            math.radians(camera.tilt_std_deg),
            math.radians(camera.roll_std_deg),
        ]
    )
    return GroundPlane(
        camera.camera_height_m,
        math.radians(camera.tilt_deg),
        math.radians(camera.roll_deg),
        np.diag(std**2),
        "given",
    )


def recorded_pose(camera: Mapping[str, Any]) -> GroundPlane | None:
    """Return the pose that a recording's transforms give, by the row of the table `cameras`."""
    if camera["recorded_height_m"] is None:
        return None
    return GroundPlane(
        camera["recorded_height_m"],
        camera["recorded_tilt_rad"],
        camera["recorded_roll_rad"],
        source="transforms",
    )


def _describe(camera: str, plane: GroundPlane, report: WalkersReport) -> Diagnostic:
    edges = f"; {report.uprights} upright edges agree" if report.uprights else ""
    return Diagnostic(
        Severity.INFO,
        "pose_from_walkers",
        f"pose from {report.people} people: height {plane.camera_height_m:.2f} ± "
        f"{report.camera_height_std_m:.2f} m, tilt {math.degrees(plane.tilt_rad):.2f} ± "
        f"{math.degrees(report.tilt_std_rad):.2f} degrees, roll {math.degrees(plane.roll_rad):.2f} ± "
        f"{math.degrees(report.roll_std_rad):.2f} degrees (one standard error); heads lie within "
        f"{report.residual_px:.1f} px of the fit{edges}",
        camera=camera,
    )
