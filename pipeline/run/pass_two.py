"""Pass 2: the columns of one stored recording become depths and heights. No picture is read.

stored measurements -> pose of the camera -> every method that applies -> estimates

Tracks are read, estimated and stored in batches, so that memory is that of a batch. What needs all of a
camera, its pose and what blur says of its lens, is asked of a sample that does not depend on them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pyarrow as pa
import pyarrow.compute as pc

from pipeline.calibrate.camera_entry import given_pose, with_assumed_centre
from pipeline.calibrate.stored_lens import known_lens, with_doubt, with_found
from pipeline.calibrate.walkers.given_pose import narrowed_by_people
from pipeline.calibrate.walkers.known_lengths import KnownHeight, KnownLengths
from pipeline.calibrate.walkers.pose import WalkersReport
from pipeline.calibrate.walkers.pose_and_lens import calibrate_stored
from pipeline.calibrate.walkers.tilt import tilt_of_people
from pipeline.calibrate.walkers.walker_veto import NotWalkers
from pipeline.core.arrays import FloatArray
from pipeline.core.camera_row import CameraRow, camera_rows
from pipeline.core.config import CameraConfig, Config
from pipeline.core.errors import CalibrationUndetermined
from pipeline.core.records import Diagnostic, FoundLens, GroundPlane, Severity
from pipeline.core.tables import TRACK_CADENCES
from pipeline.estimate.estimate_tracks import Remarks, camera_blur, estimate_tracks
from pipeline.estimate.tables import Rows
from pipeline.estimate.track_batches import Tracks
from pipeline.run.doubts.clock_notes import clock_notes, speed_notes
from pipeline.run.doubts.exposure_notes import exposure_notes, exposure_time_notes
from pipeline.run.doubts.lens_notes import lens_notes
from pipeline.run.doubts.people_check import lens_by_people, people_of, refused_pose, with_tilt
from pipeline.run.doubts.scale_notes import length_notes, scale_notes, unlike_prior
from pipeline.run.doubts.truth_notes import truth_notes
from pipeline.run.standing_part import in_standing_part, parts_of
from pipeline.run.stored_camera import StoredCamera, lines_of
from pipeline.store.database import Store
from pipeline.store.estimates import add_calibrations, add_estimates, forget_estimates
from pipeline.store.exposure_rows import exposure_verdicts
from pipeline.store.recordings import add_diagnostics, set_lens, set_pose
from pipeline.store.track_rows import tracks_of

# Observations that are worked on at once, at about 2 kB each: 40 MB. Fewer cost time, as the smoother
# goes step by step, for all tracks of a batch together: with 10,000 a seventh more than with 50,000.
BATCH = 20_000
# What the blur of a camera says as a whole is asked of so many observations; it is a few numbers.
BLUR_SAMPLE = 20_000


def estimate_recording(
    store: Store,
    recording_id: str,
    run_id: str,
    file_name: str,
    config: Config,
    batch: int = BATCH,
) -> None:
    """Estimate a stored recording by every method and store the results, inside a transaction.

    Tracks are worked on in batches of about `batch` observations; the results do not depend on it.
    """
    exposure = exposure_notes(exposure_verdicts(store, recording_id))
    config = config.of_recording(recording_id)
    cameras = camera_rows(store.read("cameras", recording_id))
    for row in cameras:
        config = config.naming(row.camera, row.topic)
    remarks = Remarks(config)
    remarks.add(exposure)
    edges = store.read("background_lines", recording_id)
    prior = config.stature
    tracks = tracks_of(store, recording_id, prior.object_class if prior else "")
    forget_estimates(store, recording_id, run_id)
    for row in cameras:
        mine = tracks.filter(pc.equal(tracks["camera"], row.camera))
        if not mine.num_rows:
            continue
        here = config.of_camera(row.camera)
        camera = StoredCamera(store, recording_id, known_lens(row, config.camera_named(row.camera)))
        lines_px = lines_of(edges, row.camera)
        stands = in_standing_part(store, recording_id, row.camera, mine)
        plane = _pose(camera, mine.filter(stands), lines_px, here, remarks)
        if plane is not None:
            set_pose(store, recording_id, row.camera, plane)
        if camera.tilt is not None and pc.all(stands).as_py():
            here, told = with_tilt(here, row.camera, camera.tilt)
            remarks.add(told)
        if camera.row != row:
            set_lens(store, recording_id, camera.row)
        cadences = [TRACK_CADENCES.empty_table()]
        for some, camera.plane in parts_of(mine, stands, plane):
            for rows in _estimated(camera, some, here, remarks, batch):
                add_estimates(store, recording_id, run_id, rows.by_table())
                cadences.append(rows.cadences)
        remarks.add(clock_notes(row.camera, pa.concat_tables(cadences), plane, here))
        remarks.add(scale_notes(row.camera, plane, mine, here))
        if prior is not None:
            walkers = prior.object_class
            remarks.add(speed_notes(store, recording_id, run_id, row.camera, walkers))
        remarks.add(length_notes(camera.row, plane, here))
        remarks.add(lens_notes(row.camera, camera.row.intrinsics))
        remarks.add(exposure_time_notes(store, recording_id, row.camera))
        remarks.add(truth_notes(store, recording_id, run_id, row.camera))
    add_calibrations(store, remarks.calibrations(), run_id)
    add_diagnostics(store, remarks.diagnostics(), recording_id, run_id, file_name)


def _estimated(
    camera: StoredCamera, tracks: Tracks, config: Config, remarks: Remarks, batch: int
) -> Iterator[Rows]:
    """Yield the rows of one batch of tracks after another."""
    blur = None
    sample = tracks.sample(BLUR_SAMPLE)
    if tracks.observations > batch or len(sample) < len(tracks):
        blur = camera_blur(camera.measured(sample), config)
        remarks.add([blur.contradicted] if blur.contradicted else [])
    for some in tracks.batches(batch):
        measured = camera.measured(some)
        if len(measured):
            yield estimate_tracks(replace(measured, camera_blur=blur), config, remarks)


def _pose(
    camera: StoredCamera, tracks: pa.Table, lines_px: FloatArray, config: Config, remarks: Remarks
) -> GroundPlane | None:
    """Return the camera's pose.

    As the camera file gives it, else by the recording's transforms, else from the people who walk. A
    claimed pose under which people are impossible is told, and not used.
    """
    name, prior = camera.row.camera, config.stature
    known = _known_lengths(config.camera_named(name))
    if known.heights:
        poses: tuple[GroundPlane | None, ...] = ()
    else:
        poses = given_pose(config.camera_named(name), camera.row), recorded_pose(camera.row)
    entry = config.camera_named(name)
    claimed = [with_assumed_centre(p, camera.row, entry) for p in poses if p is not None]
    if prior is None:
        return claimed[0] if claimed else None
    measured = camera.people(tracks, [person.track_id for person in known.heights])
    if measured is None:
        return claimed[0] if claimed else None
    camera.row, told = lens_by_people(camera.row, measured, next(iter(claimed), None), prior)
    remarks.add([told] if told else [])
    measured = replace(measured, intrinsics=camera.row.intrinsics)
    for pose in claimed:
        reason = people_of(measured, pose, prior).impossible(prior)
        if reason is None:
            pose, told = narrowed_by_people(pose, measured, entry, prior)
            remarks.add([told] if told else [])
            return pose
        remarks.add([refused_pose(name, pose, reason)])
    if camera.row.moves:
        return None
    try:
        found = calibrate_stored(measured, camera.row, prior, known, lines_px)
    except CalibrationUndetermined as error:
        remarks.add([_describe_refusal(name, error)])
        if not isinstance(error, NotWalkers) and measured.intrinsics is not None:
            camera.tilt = tilt_of_people(measured, prior)
        return None
    if found.lens is not None:
        camera.row = with_found(camera.row, found.lens)
        remarks.add([_describe_lens(name, found.lens)])
    if found.contradiction is not None:
        remarks.add([found.contradiction.describe(name, camera.row.intrinsics_source or "")])
        camera.row = with_doubt(camera.row, found.plane)
    remarks.add([_describe(name, found.plane, found.report)])
    remarks.add(unlike_prior(name, found.report.mean_ratio, prior) if known else [])
    return found.plane


def _known_lengths(camera: CameraConfig) -> KnownLengths:
    heights = tuple(KnownHeight(k.track_id, k.height_m, k.std_m) for k in camera.known_person)
    return KnownLengths(heights, camera.known_length)


def recorded_pose(camera: CameraRow) -> GroundPlane | None:
    """Return the pose that a recording's transforms give, by the row of the table `cameras`."""
    height_m, tilt_rad, roll_rad = (
        camera.recorded_height_m,
        camera.recorded_tilt_rad,
        camera.recorded_roll_rad,
    )
    if height_m is None or tilt_rad is None or roll_rad is None:
        return None
    return GroundPlane(height_m, tilt_rad, roll_rad, source="transforms")


def _describe_refusal(camera: str, error: CalibrationUndetermined) -> Diagnostic:
    refused = isinstance(error, NotWalkers)
    severity = Severity.WARNING if refused else Severity.INFO
    code = "not_walkers" if refused else "pose_undetermined"
    return Diagnostic(severity, code, f"{error.problem}. {error.remedy}", camera=camera)


def _describe_lens(camera: str, lens: FoundLens) -> Diagnostic:
    return Diagnostic(
        Severity.INFO,
        "focal_length_from_walkers",
        f"focal length from the people who walk: {lens.intrinsics.fx_px:.0f} ± {lens.std_px:.0f} px "
        "(one standard error); square pixels, the principal point in the middle and no distortion "
        "are assumed. Lens data in a camera file would be more precise",
        camera=camera,
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
